"""Checks of the controller against independent truths."""
