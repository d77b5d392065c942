"""QPs to solve: those that a run records, and a set of hard ones."""
