"""Units of the variables of parts, in terms of the SI."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Unit:
    """A unit: value in SI base units = factor times value + offset.

    Attributes
    ----------
    base : exponents of SI base units
    factor, offset : to these
    displays : factors of units to show, shown value = factor times value
    """

    base: dict[str, int] = field(default_factory=dict)
    factor: float = 1.0
    offset: float = 0.0
    displays: dict[str, float] = field(default_factory=dict)


UNITS: dict[str, Unit] = {
    "1": Unit(displays={"%": 100.0}),
    "s": Unit({"s": 1}),
    "m/s": Unit({"m": 1, "s": -1}, displays={"km/h": 3.6}),
    "W": Unit({"kg": 1, "m": 2, "s": -3}, displays={"kW": 1e-3}),
    "W/s": Unit({"kg": 1, "m": 2, "s": -4}, displays={"kW/s": 1e-3}),
    "g": Unit({"kg": 1}, factor=1e-3),
    "g/s": Unit({"kg": 1, "s": -1}, factor=1e-3),
    "g/K": Unit({"kg": 1, "K": -1}, factor=1e-3),
    "degC": Unit({"K": 1}, offset=273.15),
}
