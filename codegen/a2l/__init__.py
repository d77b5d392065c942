"""A description of a linked controller for calibration tools, ASAP2 1.7 (A2L)."""
