"""Controllers of the engine, from rules to the multi-horizon QP."""
