"""Coolant temperature to be had in good time before an engine beside a full battery cannot heat.

The same in C: codegen/runtime/mpc_floor.c.
"""

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.stages import Stages
from qpmpc.vehicle.engine import OptimalLine, alpha_at
from qpmpc.vehicle.heat import cooling_w, engine_w
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

ARRIVAL_K = 0.005  # floor at arrival, above the limit: the safety layer keeps 0.004 K from it
USABLE = 0.5  # of the room for charge: the engine's heat is not had all at once; docs/choice.md


class CoolantFloor:
    """Least coolant temperature at the end of each stage, of a plan that can keep the limit later.

    With the battery full the engine gives no more than demand and auxiliaries take. When that
    will be follows from the preview: even of a battery that is discharged wherever it can be, long
    braking fills

        S_k = clip(S_{k-1} - h_k G_off,k / E_bat, SOC_min, SOC_max),

    and what is left of it is all that the engine can charge in stage k, at most

        W_k = USABLE E_bat (SOC_max - S_{k-1}) (1 - P_brake / P_chg).

    Its largest heat then is Q(P) at P = max(P0, P_aux) + min(W_k / h_k, P_chg), and backwards from
    the end

        T_{k-1} = max(M_{k-1}, T_k - h_k (Q - Q_out(T_k)) / C).

    M is T_min, which has a margin to the limit itself. Heat that is left at arrival is of no use,
    so there M and T are `ARRIVAL_K` above the limit, and before it M is what an engine at rest
    loses until then, M_{k-1} = min(T_min, M_k + h_k Q_out(T_k) / C).

    Parameters
    ----------
    vehicle, line : parameters, and the optimal line of the engine
    battery_energy_j : energy of a unit of SOC
    least_degc : T_min, floor where the trip ahead asks for nothing more and is not about to end
    """

    def __init__(
        self, vehicle: Vehicle, line: OptimalLine, battery_energy_j: float, least_degc: float
    ) -> None:
        self._vehicle, self._energy_j, self._least = vehicle, battery_energy_j, least_degc
        self._line = line
        thermal = vehicle.thermal
        self._most = max(0.5 * (thermal.t_cl_min_degc + thermal.t_cl_max_degc), least_degc)
        self._factor = alpha_at(vehicle.cold_engine, thermal.t_cl_min_degc)
        self._factor *= vehicle.engine.lhv_j_per_g

    def at(self, stages: Stages, soc: float) -> Floats:
        """Return the floor of each stage's end, degC, shape (n,)."""
        vehicle = self._vehicle
        battery, engine, thermal = vehicle.battery, vehicle.engine, vehicle.thermal
        per_k = thermal.heat_capacity_j_per_k
        durations, speeds = stages.duration_s.tolist(), stages.speed_mps.tolist()
        gained_k = []
        room = battery.soc_max - min(max(soc, battery.soc_min), battery.soc_max)
        widest = battery.soc_max - battery.soc_min
        for h, net, off in zip(
            durations, stages.net_w.tolist(), stages.internal_off_w.tolist(), strict=True
        ):
            regen = min(max(-net / vehicle.battery_charge_max_w, 0.0), 1.0)
            charged = USABLE * room * self._energy_j * (1.0 - regen) / max(h, 1.0)
            power = max(net, battery.aux_power_w) + min(charged, vehicle.battery_charge_max_w)
            power = min(max(power, engine.power_min_w), engine.power_max_w)
            fuel_w = self._factor * self._line.fuel.at(power)
            gained_k.append(h * engine_w(thermal, fuel_w, power) / per_k)
            room = min(max(room + h * off / self._energy_j, 0.0), widest)
        floors = []
        floor = coasting = min(thermal.t_cl_min_degc + ARRIVAL_K, self._least)
        for h, speed, gain in zip(
            reversed(durations), reversed(speeds), reversed(gained_k), strict=True
        ):
            floors.append(floor)
            lost = h * cooling_w(thermal, floor, speed) / per_k
            coasting = min(coasting + lost, self._least)
            floor = min(max(coasting, floor + lost - gain), self._most)
        return np.array(floors[::-1])
