"""Functional Mock-up Units: the generated controller, and the plant, for co-simulation."""
