"""Logs and schedules of other programs: a file in any of their formats as one `LogColumns`."""
