"""A board of the user's own: a project that logs a recorded trip, and the log read again."""
