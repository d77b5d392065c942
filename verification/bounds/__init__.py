"""Lower bounds on the fuel of a trip that no controller can beat."""
