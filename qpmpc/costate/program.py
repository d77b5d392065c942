"""The stage program of one second: what `mh-qp` solves, with the true curves and on or off."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.costate.curves import Curves
from qpmpc.preview.stages import Stages
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.quantities import Quantities
from qpmpc.qp.scaling import ScalingSettings
from qpmpc.qp.settings import LimitSettings, QpSettings
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.vehicle.must_run import must_run
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Program:
    """Numbers of one second's program; shape (n,) unless said.

    With c_k the change of SOC and q_k the heat of stage k, on-share sigma, E and F = f(E) of the
    engine while on, u starts,

        min   sum_k h alpha sigma F + growing (T_k + T_k-1) + slack + start_fuel_g u_k
        SOC_k = SOC_k-1 - h / E_bat [sigma l(P0 - E) + (1 - sigma) l_off] - cranking_soc u_k
        t_end T_k + t_before T_k-1 = settled + per_fuel sigma F - per_power sigma E + per_start u_k

    and the limits. Attributes are the numbers of `qpmpc.qp.rows`, plus

    Attributes
    ----------
    curves : of the seconds ahead, the true ones
    shared : of longer stages, with the convex envelope of the fuel curve
    price_t : cost of a kelvin at the end of each stage, of its own and of the next one's `growing`
    low_w, high_w : limits of E
    must, can : whether the engine has to run, and whether it may
    start_k : heat of a start, K
    starts_on : engine state now
    rises : see `Stages`
    soc, t_cl_degc : state now, scalars
    """

    curves: Curves
    shared: Curves
    duration_s: Floats
    net_w: Floats
    off_w: Floats
    per_soc_j: float
    fuel_cost: Floats
    per_fuel: Floats
    per_power: Floats
    t_end: Floats
    t_before: Floats
    settled: Floats
    price_t: Floats
    low_w: Floats
    high_w: Floats
    must: NDArray[np.bool_]
    can: NDArray[np.bool_]
    soc_low: Floats
    soc_high: Floats
    t_low: Floats
    t_high: Floats
    slack_g_per_k: float
    start_fuel_g: float
    cranking_soc: float
    start_k: Floats
    starts_on: bool
    rises: Floats
    soc: float
    t_cl_degc: float

    @property
    def has_start(self) -> bool:
        """Whether a start costs anything."""
        return self.start_fuel_g > 0.0 or self.cranking_soc > 0.0

    @property
    def charge_per_w(self) -> Floats:
        """SOC that a watt out of the store takes in each stage, h / E_bat."""
        return self.duration_s / self.per_soc_j


class ProgramBuilder:
    """Makes the program of each second of a trip, by the numbers of the QP's table.

    Parameters
    ----------
    vehicle, model : of the plant
    stages : n
    limits : the terminal band and margins
    """

    def __init__(
        self, vehicle: Vehicle, model: PwaModel, stages: int, limits: LimitSettings
    ) -> None:
        self._vehicle = vehicle
        settings = QpSettings(**limits.model_dump(include=set(LimitSettings.model_fields)))
        self._parameters = qp_parameters(vehicle, model, settings, ScalingSettings())
        self._quantities = Quantities(self._parameters, vehicle, model, stages)
        self._curves = Curves.of(vehicle, model.line)
        self._shared = self._curves.envelope()

    def at(
        self,
        stages: Stages,
        soc: float,
        t_cl_degc: float,
        about: Linearisation,
        engine_on: bool,
    ) -> Program:
        """Return the program of a horizon and a state, expanded about a plan."""
        names = self._quantities.update(stages, soc, about, engine_on)
        number = self._parameters
        count = len(stages.duration_s)

        def value(name: str) -> Floats:
            of_stage: Any = names[name]
            return np.array(np.broadcast_to(of_stage, (count, 1))[:, 0])

        vehicle, engine = self._vehicle, self._vehicle.engine
        net, missing = stages.net_w, value("missing_w")
        low = np.maximum(engine.power_min_w, np.minimum(missing, engine.power_max_w))
        most = np.minimum(engine.power_max_w, net + vehicle.battery_charge_max_w)
        must = must_run(vehicle, net, stages.speed_mps)
        growing = value("growing")
        price_t = growing.copy()
        price_t[:-1] += growing[1:]
        per_power, per_fuel = value("per_power"), value("per_fuel")
        second_s = np.maximum(stages.duration_s, 1.0)
        soc_low, soc_high = value("soc_low"), value("soc_high")
        return Program(
            curves=self._curves,
            shared=self._shared,
            duration_s=stages.duration_s,
            net_w=net,
            off_w=stages.internal_off_w,
            per_soc_j=number["battery_energy_j"],
            fuel_cost=stages.duration_s * value("alpha"),
            per_fuel=per_fuel,
            per_power=per_power,
            t_end=1.0 + value("per_end"),
            t_before=value("per_end") - value("per_start"),
            settled=value("settled_k"),
            price_t=price_t,
            low_w=low,
            high_w=np.maximum(most, low),
            must=must,
            can=must | (most >= engine.power_min_w),
            soc_low=soc_low,
            soc_high=soc_high,
            t_low=value("floor_degc"),
            t_high=np.full(count, number["t_max_degc"]),
            slack_g_per_k=number["slack_g_per_k"],
            start_fuel_g=number["start_fuel_g"],
            cranking_soc=number["cranking_j"] / number["battery_energy_j"],
            start_k=per_power * number["lhv_j_per_g"] * number["start_fuel_g"] / second_s,
            starts_on=engine_on,
            rises=stages.rises,
            soc=soc,
            t_cl_degc=t_cl_degc,
        )
