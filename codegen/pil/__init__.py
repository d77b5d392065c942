"""Processor in the loop: the firmware drives a cycle, counted, compared, reported."""
