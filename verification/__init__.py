"""Checks of the controller against independent references."""
