"""What a controller believes of its vehicle where that is not the truth."""

from collections.abc import Iterator, Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from qpmpc.settings import apply_settings, validated
from qpmpc.vehicle.engine import optimal_line
from qpmpc.vehicle.engine_parameters import LINE, LINE_TOO, MAP
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.section import POINTS_MAX, Section

SECTION = "model"  # of settings: model.fuel_level=1.1
RESISTANCES = ("resistance_discharge_ohm", "resistance_charge_ohm")
Factor = Annotated[float, Field(ge=0.5, le=2.0)]


class Belief(Section):
    """A controller's model over its plant: factors, 1 where it is right.

    Attributes
    ----------
    fuel_level : fuel rate of the hot engine
    fuel_tilt : t of f(P) (1 + t (2 P / P_max - 1)): the rate is wrong by -t at idle and by +t at
        rated power
    fuel_idle : fuel rate at no power; the same g/s are added at every power
    mass, eta_drive : of the chassis
    resistance, capacity : of the battery, the first of discharge and charge
    heat_capacity, ua : of the coolant, and its loss to the air
    """

    fuel_level: Factor = 1.0
    fuel_tilt: Annotated[float, Field(ge=-0.3, le=0.3)] = 0.0
    fuel_idle: Factor = 1.0
    mass: Factor = 1.0
    eta_drive: Factor = 1.0
    resistance: Factor = 1.0
    capacity: Factor = 1.0
    heat_capacity: Factor = 1.0
    ua: Factor = 1.0

    @classmethod
    def of_settings(cls, settings: Mapping[str, object]) -> "Belief":
        """Make it of dotted settings, such as ``{"model.mass": 1.1}``.

        Raises
        ------
        InputError
            If a name or value is not allowed.
        """
        own = {key.removeprefix(f"{SECTION}."): value for key, value in settings.items()}
        return validated(cls, apply_settings(cls().model_dump(), own, owner=SECTION), SECTION)

    def of(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle believed in.

        Raises
        ------
        InputError
            If no vehicle may be so.
        """
        chassis, battery, thermal = vehicle.chassis, vehicle.battery, vehicle.thermal
        scaled = (
            (self.mass, "chassis", chassis, ("mass_kg",)),
            (self.eta_drive, "chassis", chassis, ("eta_drive",)),
            (self.resistance, "battery", battery, RESISTANCES),
            (self.capacity, "battery", battery, ("capacity_ah",)),
            (self.heat_capacity, "thermal", thermal, ("heat_capacity_j_per_k",)),
            (self.ua, "thermal", thermal, ("ua0_w_per_k", "ua1_w_per_k_per_mps")),
        )
        changed: dict[str, object] = {}
        for factor, section, of, names in scaled:
            for name in names if factor != 1.0 else ():
                value = factor * np.asarray(getattr(of, name))
                changed[f"{section}.{name}"] = value.tolist()
        if (self.fuel_level, self.fuel_tilt, self.fuel_idle) != (1.0, 0.0, 1.0):
            changed |= self._line(vehicle)
        data = apply_settings(vehicle.model_dump(), changed, owner=SECTION)
        return validated(Vehicle, data, f"the {SECTION} of vehicle {vehicle.name}")

    def _line(self, vehicle: Vehicle) -> dict[str, object]:
        """The engine's optimal line, in place of its map."""
        line = optimal_line(vehicle.engine)
        thin = -(-len(line.power_w) // POINTS_MAX)
        share = line.power_w / line.power_max_w
        fuel = line.fuel_g_per_s + (self.fuel_idle - 1.0) * line.fuel_g_per_s[0]
        fuel = self.fuel_level * fuel * (1.0 + self.fuel_tilt * (2.0 * share - 1.0))
        keep = np.unique(np.append(np.arange(0, len(fuel), thin), len(fuel) - 1))
        other = dict.fromkeys([*MAP, *LINE_TOO])
        values = dict(zip(LINE, (line.power_w[keep].tolist(), fuel[keep].tolist()), strict=True))
        return {f"engine.{name}": value for name, value in {**other, **values}.items()}


def is_of_model(key: str) -> bool:
    """Whether a dotted setting is one of `Belief`."""
    return key.startswith(f"{SECTION}.")


def with_settings(
    vehicle: Vehicle, model: Vehicle | None, settings: Mapping[str, object]
) -> tuple[Vehicle, Vehicle | None]:
    """Return vehicle and model with dotted settings: those of the vehicle apply to both.

    Raises
    ------
    InputError
        If a key does not exist or a value is not allowed.
    """
    of_vehicle = {k: value for k, value in settings.items() if not is_of_model(k)}
    of_model = {k: value for k, value in settings.items() if is_of_model(k)}
    vehicle = vehicle.with_settings(of_vehicle)
    if of_model:
        return vehicle, Belief.of_settings(of_model).of(vehicle)
    return vehicle, None if model is None else model.with_settings(of_vehicle)


def differences(vehicle: Vehicle, model: Vehicle) -> Iterator[str]:
    """Say in which parameters a model differs; the many ways to give the fuel are one."""
    for section in ("chassis", "engine", "cold_engine", "thermal", "battery", "trip"):
        own, its = getattr(vehicle, section), getattr(model, section)
        names = [n for n in type(own).model_fields if getattr(own, n) != getattr(its, n)]
        of_fuel = {*MAP, *LINE, *LINE_TOO}
        if section == "engine" and of_fuel.intersection(names):
            line, believed = optimal_line(own), optimal_line(its)
            at = (0.0, 0.5 * line.power_max_w, line.power_max_w)
            ratios = (believed.fuel.at(p) / line.fuel.at(p) for p in at)
            yield f"fuel {', '.join(f'{r:.3g}' for r in ratios)} times at idle, half, full power"
        for name in names if section != "engine" else [n for n in names if n not in of_fuel]:
            value, believed_value = np.asarray(getattr(own, name)), np.asarray(getattr(its, name))
            if value.shape == believed_value.shape and np.all(value != 0.0):
                ratio = believed_value / value
                same = np.allclose(ratio, ratio.flat[0])
                yield f"{section}.{name}" + (f" {ratio.flat[0]:.3g} times" if same else "")
            else:
                yield f"{section}.{name}"
