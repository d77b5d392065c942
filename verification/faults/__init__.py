"""Faults of every kind on one trip: what each costs. The table of docs/faults.md."""
