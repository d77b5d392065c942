"""How the controller's settings were chosen: a re-runnable search, one setting at a time."""
