"""Controllers: what drives the engine, from rules to the multi-horizon QP."""
