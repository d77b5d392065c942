"""The whole controller as C: generator, host library, firmware, processor in the loop."""
