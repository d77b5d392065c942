"""Accuracy against speed: backends, iteration counts and formulations driving whole cycles."""
