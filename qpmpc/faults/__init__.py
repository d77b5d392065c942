"""Faults of sensors, preview, solver, clock and ECU, injected into a run. See docs/faults.md."""
