"""`mh-qp` beside the nonlinear program it approximates: plan by plan, and run by run."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.closed_loop import drive
from qpmpc.codegen.implementation import mh_qp
from qpmpc.controllers.base import Decision
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.controllers.qp_planner import QpPlan
from qpmpc.controllers.receding_horizon import RecedingHorizon
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.qp.rows import Var
from qpmpc.trip import Observation, Trip
from qpmpc.verification.nonlinear.driven_plan import PlanDriver
from qpmpc.verification.nonlinear.mh_nlp import MhNlp
from qpmpc.verification.nonlinear.problem import NlpVar
from qpmpc.verification.nonlinear.solver import NlpPlan

Floats = NDArray[np.float64]

ON_LEAST = 0.01  # on-share from which a stage of the NLP counts as burning fuel


@dataclass(frozen=True)
class PlanPair:
    """Both plans from the same state, at one step of the closed loop of `mh-qp`.

    Attributes
    ----------
    step : of the trip
    qp_on_share, nlp_on_share : sigma of the first second
    qp_power_w, nlp_power_w : engine power of the first second, mean over it (E)
    soc_difference : largest difference of the predicted SOC, over all stages
    soc_end_difference : of the predicted SOC at arrival
    t_cl_difference_k : the same of the coolant, up to the last stage in which fuel is planned;
        after it heat has no use, and the QP leaves it undetermined
    qp_fuel_g, nlp_fuel_g : fuel to arrival of both plans, driven on the exact maps, with that of
        starts; SOC at arrival priced by the costate of the nonlinear program
    """

    step: int
    qp_on_share: float
    nlp_on_share: float
    qp_power_w: float
    nlp_power_w: float
    soc_difference: float
    soc_end_difference: float
    t_cl_difference_k: float
    qp_fuel_g: float
    nlp_fuel_g: float


@dataclass(frozen=True)
class OpenLoopComparison:
    """Plans of both programs along one cycle; unsolved NLPs are counted and left out."""

    cycle: str
    pairs: list[PlanPair]
    nlp_unsolved: int

    def summary(self) -> dict[str, Any]:
        """Return the differences as plain data; fuel in percent of the fuel of the whole trip."""
        pairs, trip_fuel_g = self.pairs, self.pairs[0].nlp_fuel_g
        fuel = np.array([pair.qp_fuel_g - pair.nlp_fuel_g for pair in pairs])
        return {
            "cycle": self.cycle,
            "states": len(pairs),
            "nlp_unsolved": self.nlp_unsolved,
            "same_on_off_share": float(
                np.mean([(p.qp_on_share < 0.5) == (p.nlp_on_share < 0.5) for p in pairs])
            ),
            "first_power_w": _spread(np.array([p.qp_power_w - p.nlp_power_w for p in pairs])),
            "soc_end": _spread(np.array([pair.soc_end_difference for pair in pairs])),
            "soc": _spread(np.array([pair.soc_difference for pair in pairs])),
            "t_cl_k": _spread(np.array([pair.t_cl_difference_k for pair in pairs])),
            "planned_fuel_percent": _spread(100.0 * fuel / trip_fuel_g),
        }


@dataclass(frozen=True)
class ClosedLoopComparison:
    """Both controllers on one cycle, in one process; figures as in `Run.summary`.

    Attributes
    ----------
    fuel_difference_percent : SOC-balanced fuel of `mh-qp` against that of `mh-nlp`
    time_ratio : step time of `mh-qp` over that of `mh-nlp`, median, p99 and max
    """

    cycle: str
    qp: dict[str, Any]
    nlp: dict[str, Any]
    fuel_difference_percent: float
    time_ratio: dict[str, float]


@dataclass(frozen=True)
class NlpComparison:
    """Open and closed loop, cycle by cycle."""

    open_loop: list[OpenLoopComparison]
    closed_loop: list[ClosedLoopComparison]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, ready for JSON."""
        return {
            "open_loop": [one.summary() for one in self.open_loop],
            "closed_loop": [asdict(one) for one in self.closed_loop],
        }


def _pair(driver: PlanDriver, seen: Observation, qp: QpPlan, nlp: NlpPlan) -> PlanPair:
    h = qp.stages.duration_s
    soc = np.abs(qp.x[:, Var.SOC] - nlp.x[:, NlpVar.SOC])
    t_cl = np.abs(qp.x[:, Var.T_CL] - nlp.x[:, NlpVar.T_CL])
    sigma = nlp.x[:, NlpVar.ON]
    power = np.array([nlp.power_on_w(stage) for stage in range(len(h))])
    qp_end = driver.drive(qp.stages, seen, qp.x[:, Var.ON], qp.x[:, Var.P_ENG])
    nlp_end = driver.drive(nlp.stages, seen, sigma, sigma * power)
    soc_end = qp_end.soc_end - nlp_end.soc_end
    counts = h > 0.0
    burning = np.flatnonzero(counts & (sigma > ON_LEAST))
    warmed = slice(0, 1 + (int(burning[-1]) if burning.size else 0))
    return PlanPair(
        step=seen.step,
        qp_on_share=float(qp.x[0, Var.ON]),
        nlp_on_share=float(sigma[0]),
        qp_power_w=float(qp.x[0, Var.P_ENG]),
        nlp_power_w=float(sigma[0] * power[0]),
        soc_difference=float(soc[counts].max()),
        soc_end_difference=float(soc[counts][-1]),
        t_cl_difference_k=float(t_cl[warmed].max()),
        qp_fuel_g=qp_end.fuel_g - nlp.soc_costate_g * soc_end,
        nlp_fuel_g=nlp_end.fuel_g,
    )


def compare_open_loop(
    trip: Trip, every: int = 5, settings: ControllerSettings | None = None
) -> OpenLoopComparison:
    """Plan with both programs at every `every`-th state of the closed loop of `mh-qp`.

    Raises
    ------
    QpmpcError
        If CasADi is not installed.
    """
    driver, nlp = MhQp(trip, settings), MhNlp(trip, settings)
    plans = PlanDriver(nlp.solver.problem)
    nlp.depart(trip.start)
    pairs: list[PlanPair] = []
    unsolved = 0

    def plan_too(seen: Observation, decision: Decision) -> None:
        nonlocal unsolved
        qp = driver.planner.last
        if seen.step % every == 0 and qp is not None and not decision.fallback:
            beside = nlp.solve(seen)
            if beside.solved:
                pairs.append(_pair(plans, seen, qp, beside))
            else:
                unsolved += 1

    drive(trip, driver, on_step=plan_too)
    return OpenLoopComparison(trip.cycle.name, pairs, unsolved)


def compare_closed_loop(
    trip: Trip, settings: ControllerSettings | None = None
) -> ClosedLoopComparison:
    """Drive a trip with both controllers.

    Raises
    ------
    QpmpcError
        If CasADi is not installed.
    """
    nlp_controller = RecedingHorizon(trip, MhNlp(trip, settings))
    qp = drive(trip, mh_qp(trip, settings)).summary()
    nlp = drive(trip, nlp_controller).summary()
    fuel = "fuel_soc_balanced_g"
    return ClosedLoopComparison(
        cycle=trip.cycle.name,
        qp=qp,
        nlp=nlp,
        fuel_difference_percent=100.0 * (qp[fuel] / nlp[fuel] - 1.0),
        time_ratio={
            key: qp["step_time_ms"][key] / nlp["step_time_ms"][key] for key in nlp["step_time_ms"]
        },
    )


def compare(trips: Iterable[Trip], every: int = 5) -> NlpComparison:
    """Compare open and closed loop on several trips; see `compare_open_loop`."""
    listed = list(trips)
    return NlpComparison(
        [compare_open_loop(trip, every) for trip in listed],
        [compare_closed_loop(trip) for trip in listed],
    )


def _spread(differences: Floats) -> dict[str, float]:
    """Mean, median, 95th percentile and largest of the absolute differences."""
    size = np.abs(differences)
    return {
        "mean": float(size.mean()),
        "median": float(np.median(size)),
        "p95": float(np.percentile(size, 95)),
        "max": float(size.max()),
    }
