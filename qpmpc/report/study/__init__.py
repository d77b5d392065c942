"""Report of a study of many runs, and the comparison of two studies, from their tables."""
