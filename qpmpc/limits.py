"""Where a run left the limits of its car, and whether any command could have kept them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.safety import SafetyLayer
from qpmpc.trajectory import Trajectory
from qpmpc.trip import Observation
from qpmpc.vehicle import Command, Plant, Vehicle
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.must_run import SPEED_ROUNDING_MPS

Floats = NDArray[np.float64]

SAME_POWER_W = 1.0  # commands of one meaning: single precision differs by less
# rounding of a plant in double precision
SOC_ROUNDING, T_CL_ROUNDING_K, POWER_ROUNDING_W = 1e-12, 1e-9, 1e-6


@dataclass(frozen=True)
class Excess:
    """Excess of a run over each pair of limits, second by second; shape (steps,), 0 where kept.

    Attributes
    ----------
    power_w : of the command over the limits of engine and battery
    soc, t_cl_k : at the end of each second
    shortage_w : demand beyond what engine and battery give at most, above soc_min
    off_mps : speed beyond that at which the car may be driven with its engine off, while it is
    """

    power_w: Floats
    soc: Floats
    t_cl_k: Floats
    shortage_w: Floats
    off_mps: Floats

    @property
    def any(self) -> NDArray[np.bool_]:
        """Seconds in which a limit is exceeded."""
        return (
            (self.power_w > POWER_ROUNDING_W)
            | (self.soc > SOC_ROUNDING)
            | (self.t_cl_k > T_CL_ROUNDING_K)
            | (self.shortage_w > POWER_ROUNDING_W)
            | (self.off_mps > SPEED_ROUNDING_MPS)
        )


def excess_of(vehicle: Vehicle, run: Trajectory) -> Excess:
    """Compute the excess of a run."""
    battery, thermal = vehicle.battery, vehicle.thermal
    maps = BatteryMaps(battery)
    emptying = [maps.power_to_reach_w(soc, battery.soc_min, 1.0) for soc in run.soc[:-1].tolist()]
    gives_w = np.clip(emptying, 0.0, vehicle.battery_discharge_max_w)
    needed_w = run.demand_w + battery.aux_power_w
    return Excess(
        run.power_excess_w,
        _beyond(run.soc[1:], battery.soc_min, battery.soc_max),
        _beyond(run.t_cl_degc[1:], thermal.t_cl_min_degc, thermal.t_cl_max_degc),
        np.maximum(needed_w - vehicle.engine.power_max_w - gives_w, 0.0),
        np.where(run.engine_on, 0.0, _beyond(run.speed_mps, 0.0, vehicle.engine.electric_max_mps)),
    )


def _beyond(values: Floats, low: float, high: float) -> Floats:
    return np.maximum(np.maximum(low - values, values - high), 0.0)


def sentence(vehicle: Vehicle, run: Trajectory, excess: Excess) -> str:
    """Say where limits are exceeded, by how much, and whether the trip is beyond the car.

    It is where no command keeps all limits of the next second, which the safety layer knows: the
    command applied is then its own. Another choice earlier on may have kept them: only dynamic
    programming can tell. Empty if all limits are kept.
    """
    seconds = np.flatnonzero(excess.any).tolist()
    if not seconds:
        return ""
    layer = SafetyLayer(Plant(vehicle))
    unavoidable = all(_is_safest(layer, run, k) for k in seconds)
    soc, coolant = vehicle.battery, vehicle.thermal
    parts = [
        (excess.shortage_w, f"demand {excess.shortage_w.max() / 1e3:.3g} kW more than engine and "
         "battery can give"),
        (excess.soc, f"SOC {excess.soc.max():.2g} outside {soc.soc_min:g}..{soc.soc_max:g}"),
        (excess.t_cl_k, f"coolant {excess.t_cl_k.max():.2g} K outside "
         f"{coolant.t_cl_min_degc:g}..{coolant.t_cl_max_degc:g} °C"),
        (excess.power_w, f"power {excess.power_w.max():.3g} W beyond its limits"),
        (excess.off_mps, f"engine off at {excess.off_mps.max():.3g} m/s more than "
         "engine.electric_max_mps"),
    ]  # fmt: skip
    worst = ", ".join(text for values, text in parts if values.any()) + _departs(vehicle, run)
    where = f"from {seconds[0]} s on, in {len(seconds)} of {len(run.fuel_g)} s,"
    if unavoidable:
        return f"{where} the trip is beyond the car, whatever the command of that second: {worst}"
    return f"{where} limits are exceeded: {worst}"


def _departs(vehicle: Vehicle, run: Trajectory) -> str:
    """Say that the coolant is outside its limits before anything is commanded."""
    thermal, at_degc = vehicle.thermal, float(run.t_cl_degc[0])
    if thermal.t_cl_min_degc <= at_degc <= thermal.t_cl_max_degc:
        return ""
    if at_degc < thermal.t_cl_min_degc:
        return (
            f"; it departs at {at_degc:g} °C: a cold start asks for a lower thermal.t_cl_min_degc"
        )
    return f"; it departs at {at_degc:g} °C"


def _is_safest(layer: SafetyLayer, run: Trajectory, k: int) -> bool:
    """Whether the safety layer leaves the command of a second as it was."""
    applied = Command(bool(run.engine_on[k]), float(run.p_eng_w[k]))
    ran, before_w = (bool(run.engine_on[k - 1]), float(run.p_eng_w[k - 1])) if k else (False, 0.0)
    state = float(run.soc[k]), float(run.t_cl_degc[k]), ran
    road = float(run.demand_w[k]), float(run.speed_mps[k])
    # no shortest run or rest: they are weaker than any limit
    seen = Observation(k, *state, *road, p_eng_before_w=before_w)
    best = layer.admissible(applied, seen)
    close = abs(best.p_eng_w - applied.p_eng_w) <= SAME_POWER_W
    return best.engine_on == applied.engine_on and close
