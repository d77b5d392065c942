"""The controller as C for embedded targets."""
