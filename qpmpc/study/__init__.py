"""Studies: many runs over cycles, vehicles, settings, controllers, forecasts and faults."""
