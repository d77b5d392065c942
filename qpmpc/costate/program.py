"""The stage program of one second: what `mh-qp` solves, with the true curves and on or off."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.preview.horizon import HorizonSettings
from qpmpc.preview.stages import Stages
from qpmpc.pwa.curves import Curves
from qpmpc.pwa.model import PwaModel
from qpmpc.qp.expressions import code_of, parsed, targets_of
from qpmpc.qp.linearisation import Linearisation
from qpmpc.qp.quantities import Quantities
from qpmpc.qp.rows import table_of
from qpmpc.qp.scaling import ScalingSettings
from qpmpc.qp.settings import LimitSettings, QpSettings
from qpmpc.qp.stage_qp import qp_parameters
from qpmpc.vehicle.parameters import Vehicle

Floats = NDArray[np.float64]

# Numbers of a stage from those of the QP's table, in numpy and in C; see `Program`.
TAKEN = ["growing", "per_fuel", "per_power", "soc_low", "soc_high"]
PROGRAM = """
fuel_cost = duration_s * alpha
charge_per_w = duration_s / battery_energy_j
t_end = 1.0 + per_end
t_before = per_end - per_start
settled = settled_k
free_room_w = free_net_w + battery_charge_max_w
low_w = max(engine_min_w, min(free_net_w - battery_discharge_max_w, engine_max_w))
high_w = max(min(engine_max_w, free_room_w), low_w)
forced_net_w = (net_w - (1.0 - must_share) * free_net_w) / max(must_share, LEAST_FORCED)
forced_low_w = max(engine_min_w, min(forced_net_w - battery_discharge_max_w, engine_max_w))
forced_high_w = max(min(engine_max_w, forced_net_w + battery_charge_max_w), forced_low_w)
t_low = floor_degc - origin_t_cl_degc
t_high = t_max_degc - origin_t_cl_degc
start_k = per_power * lhv_j_per_g * start_fuel_g / max(duration_s, SHORTEST_SCALE_S)
"""
MADE = [target for line in parsed(PROGRAM) for target in targets_of(line)]
_PROGRAM_CODE = code_of(parsed(PROGRAM))


# s, cost of off less that of on over which the on-share goes from 0 to 1, of a second and of a
# longer stage. Where starts are free the engine runs in the seconds of a class that ask for most;
# where they cost, through it.
SWITCH_G_PER_S, LONG_SWITCH_G_PER_S = 0.03, 0.05
START_SWITCH_G_PER_S, START_LONG_SWITCH_G_PER_S = 0.01, 0.015
LEAST_SWITCH_G = 1e-4  # of a masked stage, or one in which a charge is worth next to nothing
LEAST_WORTH = 0.1  # of these costs, where a charge is worth nearly nothing, or the engine idles
USUAL_CHARGE = 1.3  # lambda of a usual trip, in fuel of the engine at its best
MODERATE = 0.15  # of the engine's power


def switches_g_per_s(has_start: bool) -> tuple[float, float]:
    """Return s of a second and of a longer stage."""
    if has_start:
        return START_SWITCH_G_PER_S, START_LONG_SWITCH_G_PER_S
    return SWITCH_G_PER_S, LONG_SWITCH_G_PER_S


def unit_g(model: PwaModel) -> float:
    """Return the fuel that charges the whole battery, with the engine at its best, g."""
    line = model.line
    best_g_per_j = float((line.fuel_g_per_s[1:] / line.power_w[1:]).min())
    return best_g_per_j * model.battery_energy_j


def moderate(curves: Curves) -> tuple[float, float]:
    """Return a moderate power of the engine, W, and the fuel that it takes, g/s."""
    power_w = MODERATE * curves.end_w[-1:]
    return float(power_w[0]), float(curves.fuel_g_per_s(power_w)[0])


@dataclass(frozen=True)
class Program:
    """Numbers of one second's program; shape (n,) unless said.

    With c_k the change of SOC and q_k the heat of stage k, on-share sigma, E and F = f(E) of the
    engine while on, u starts,

        min   sum_k h alpha sigma F + growing (T_k + T_k-1) + slack + start_fuel_g u_k
        SOC_k = SOC_k-1 - h / E_bat [sigma l(P0 - E) + (1 - sigma) l_off] - cranking_soc u_k
        t_end T_k + t_before T_k-1 = settled + per_fuel sigma F - per_power sigma E + per_start u_k

    and the limits. Where the engine must run in a share m of the seconds of a longer stage, these
    have a power E_m of their own, at their own P0; sigma, E, P0 and l_off are of the others:
    m E_m + (1 - m) sigma E takes the place of sigma E, likewise F and l. Attributes are the numbers
    of `qpmpc.qp.rows`, plus

    Attributes
    ----------
    curves : of the seconds ahead, the true ones
    shared : of longer stages, with the convex envelope of the fuel curve
    short, classes : number of seconds ahead, and of stages of a block
    charge_per_w : SOC that a watt out of the store takes in each stage, h / E_bat
    price_t : cost of a kelvin at the end of each stage, of its own and of the next one's `growing`
    low_w, high_w : limits of E
    net_w, off_w : P0 and l(P0) of the seconds with a choice; of all where there is none
    must, can : whether the engine has to run in all seconds, and whether it may in those with a
        choice
    forced, forced_net_w, forced_low_w, forced_high_w : m where it is between 0 and 1, else 0; of
        these seconds
    free : 1 - forced
    start_k : heat of a start, K
    starts_on : engine state now
    rises : see `Stages`; of sigma, and so fewer by the share without a choice
    width : W, cost of on against off over which the search smoothes the switch, g
    widest : the most that it is, h s; `width` is that until `smoothed`
    usual_charge_g : lambda of a usual trip
    soc, t_cl_degc : state now, scalars
    """

    curves: Curves
    shared: Curves
    short: int
    classes: int
    duration_s: Floats
    net_w: Floats
    off_w: Floats
    charge_per_w: Floats
    fuel_cost: Floats
    per_fuel: Floats
    per_power: Floats
    t_end: Floats
    t_before: Floats
    settled: Floats
    price_t: Floats
    low_w: Floats
    high_w: Floats
    forced_net_w: Floats
    forced_low_w: Floats
    forced_high_w: Floats
    must: NDArray[np.bool_]
    forced: Floats
    free: Floats
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
    width: Floats
    widest: Floats
    usual_charge_g: float
    soc: float
    t_cl_degc: float

    @property
    def has_start(self) -> bool:
        """Whether a start costs anything."""
        return self.start_fuel_g > 0.0 or self.cranking_soc > 0.0


class ProgramBuilder:
    """Makes the program of each second of a trip, by the numbers of the QP's table.

    Parameters
    ----------
    vehicle, model : of the plant
    stages : n
    limits : the terminal band and margins
    layout : of the stages
    """

    def __init__(
        self,
        vehicle: Vehicle,
        model: PwaModel,
        stages: int,
        limits: LimitSettings,
        layout: HorizonSettings,
    ) -> None:
        self._layout = layout
        settings = QpSettings(**limits.model_dump(include=set(LimitSettings.model_fields)))
        self._parameters = qp_parameters(vehicle, model, settings, ScalingSettings())
        self._quantities = Quantities(self._parameters, vehicle, model, stages)
        self._curves = Curves.of(vehicle, model.line)
        self._shared = self._curves.envelope()
        self._usual_g = USUAL_CHARGE * unit_g(model)
        self._has_start = table_of(vehicle.engine).has_start

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
        exec(_PROGRAM_CODE, names)
        number = self._parameters
        count = len(stages.duration_s)

        def value(name: str) -> Floats:
            of_stage: Any = names[name]
            return np.array(np.broadcast_to(of_stage, (count, 1))[:, 0])

        of = {name: value(name) for name in (*TAKEN, *MADE)}
        growing, room_w = of.pop("growing"), of.pop("free_room_w")
        must = stages.must_share >= 1.0
        forced = np.where(must, 0.0, stages.must_share)
        rises = stages.rises * (1.0 - forced)
        rises[1:] *= 1.0 - forced[:-1]
        second, longer = switches_g_per_s(self._has_start)
        width = np.where(stages.duration_s > 1.0, longer, second) * stages.duration_s
        widest = np.maximum(width * (1.0 - forced), LEAST_SWITCH_G)
        price_t = growing.copy()
        price_t[:-1] += growing[1:]
        return Program(
            curves=self._curves,
            shared=self._shared,
            short=self._layout.short_stages,
            classes=self._layout.classes,
            duration_s=stages.duration_s,
            net_w=stages.free_net_w,
            off_w=stages.free_internal_off_w,
            price_t=price_t,
            must=must,
            forced=forced,
            free=1.0 - forced,
            can=must | (room_w >= number["engine_min_w"]),
            slack_g_per_k=number["slack_g_per_k"],
            start_fuel_g=number["start_fuel_g"],
            cranking_soc=number["cranking_j"] / number["battery_energy_j"],
            starts_on=engine_on,
            rises=rises,
            width=widest,
            widest=widest,
            usual_charge_g=self._usual_g,
            soc=soc,
            t_cl_degc=t_cl_degc,
            **of,
        )
