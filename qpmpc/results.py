"""Results of a run: the figures computed from its trajectory, JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpmpc.controllers.monitor import Flag
from qpmpc.engine_runs import run_figures
from qpmpc.limits import Excess, excess_of, sentence
from qpmpc.qp.expectation import Expectation
from qpmpc.shown import shown, two_digits
from qpmpc.trajectory import Trajectory
from qpmpc.vehicle.battery import BatteryMaps
from qpmpc.vehicle.parameters import Vehicle
from qpmpc.vehicle.section import STEP_S

Floats = NDArray[np.float64]

REFERENCE, OPTIMUM = "rule-based", "dp"  # controllers that the others are compared with
COMPARABLE_SHARE = 0.03  # largest SOC correction, as a share of fuel, of a comparable run
J_PER_KWH = 3.6e6
MOSTLY = 0.5  # share of the time
OFF_EXPECTED_PERCENT = 1.0  # from which on a run's fuel is in doubt, see docs/qp.md
LOOSE_GAP = 0.1  # mean slack of the relaxed curves from which on a plan cannot be driven


@dataclass
class Run:
    """One finished run.

    Attributes
    ----------
    cycle, controller, solver : names; solver is empty where there is none
    implementation : language that the controller ran in
    remarks : what a user should know about the choices made for this run, one line each
    vehicle : parameters, overrides included
    trajectory : second by second
    faults : what injected faults did, as plain data; see `qpmpc.faults.effects`
    plant : what a foreign plant did not obey, as plain data; None on the vehicle's own plant
    reservations : why its controller says that its fuel cannot be compared
    expects : what its controller expected at departure
    soc_price_g : fuel that a unit of final SOC is worth, from a controller that knows: `dp`
    figures : a user's own, by name with unit, see `compare`
    """

    cycle: str
    controller: str
    solver: str
    implementation: str
    remarks: tuple[str, ...]
    vehicle: Vehicle = field(repr=False)
    distance_km: float
    trajectory: Trajectory = field(repr=False)
    faults: dict[str, Any] | None = None
    plant: dict[str, Any] | None = None
    reservations: tuple[str, ...] = ()
    expects: Expectation | None = None
    soc_price_g: float | None = None
    figures: Mapping[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        said = [f"{self.fuel_soc_balanced_g:.1f} g of fuel, SOC-balanced", *self.remarks]
        return f"{shown(self.controller)} on {shown(self.cycle)}: {'; '.join(map(shown, said))}"

    @property
    def fuel_g(self) -> float:
        """Fuel burnt."""
        return float(self.trajectory.fuel_g.sum())

    @property
    def soc_correction_g(self) -> float:
        """(SOC_target - SOC_end) E_bat / (eta_eq LHV): fuel that the battery gave or took.

        With `trip.soc_end_at_least` what is above the target is worth nothing.
        """
        return self._correction_g(float(self.trajectory.soc[-1]))

    def _correction_g(self, soc_end: float) -> float:
        return self._worth_g(self._missing(soc_end))

    def _missing(self, soc_end: float) -> float:
        missing = self.soc_target - soc_end
        return max(missing, 0.0) if self.vehicle.trip.soc_end_at_least else missing

    def fuel_balanced_at_g(self, soc_price_g: float) -> float:
        """Fuel as if the run had ended at the SOC asked for, at a price of a unit of SOC."""
        return self.fuel_g + soc_price_g * self._missing(float(self.trajectory.soc[-1]))

    def _worth_g(self, soc: float) -> float:
        trip, engine = self.vehicle.trip, self.vehicle.engine
        energy_j = BatteryMaps(self.vehicle.battery).energy_j(trip.soc_target)
        return soc * energy_j / (trip.eta_eq * engine.lhv_j_per_kg * 1e-3)

    @property
    def soc_target(self) -> float:
        """SOC to arrive with; without `trip.soc_end` that of departure, wherever that is."""
        asked = self.vehicle.trip.soc_end
        return float(self.trajectory.soc[0]) if asked is None else asked

    @property
    def depletion_g(self) -> float:
        """Fuel worth of what the battery was to give, (SOC_init - SOC_target) E_bat likewise."""
        return max(self._worth_g(float(self.trajectory.soc[0]) - self.soc_target), 0.0)

    @property
    def battery_used_j(self) -> float:
        """Energy that left the battery's store, C_bat times the integral of U_oc over SOC."""
        soc = self.trajectory.soc
        return BatteryMaps(self.vehicle.battery).energy_between_j(float(soc[-1]), float(soc[0]))

    @property
    def fuel_soc_balanced_g(self) -> float:
        """Fuel as if the run had ended at the SOC asked for."""
        return self.fuel_g + self.soc_correction_g

    @property
    def fuel_expected_g(self) -> float | None:
        """SOC-balanced fuel that the plan at departure expected; None without such a plan."""
        if self.expects is None:
            return None
        return self.expects.fuel_g + self._correction_g(self.expects.soc_end)

    @property
    def fuel_off_expected_percent(self) -> float | None:
        """How far SOC-balanced fuel is above, or below, what was expected at departure."""
        expected_g = self.fuel_expected_g
        if not expected_g:
            return None
        return 100.0 * (self.fuel_soc_balanced_g / expected_g - 1.0)

    @property
    def doubt(self) -> str:
        """Why its fuel may be far from the optimum, in a line; empty if nothing tells so."""
        off = self.fuel_off_expected_percent
        if off is None or abs(off) <= OFF_EXPECTED_PERCENT:
            return ""
        gap = _max_and_mean(self.trajectory.relaxation_gap)["mean"] or 0.0
        why = (
            f"its plans are {two_digits(100.0 * gap)} % off the curves of fuel and losses, by a "
            "term that gains by losses or by too few iterations, and no car can drive them"
            if gap > LOOSE_GAP
            else "the forecast was wrong or the plan a poor one, and the fuel may be far from the "
            "optimum"
        )
        return (
            f"{self.controller} on {self.cycle}: fuel is {two_digits(abs(off))} % "
            f"{'above' if off > 0.0 else 'below'} what the plan at departure expected: {why}"
        )

    @cached_property
    def excess(self) -> Excess:
        """Excess over the limits, second by second."""
        return excess_of(self.vehicle, self.trajectory)

    @cached_property
    def not_comparable(self) -> list[str]:
        """Why the run's fuel cannot be compared with that of others; empty if it can."""
        found = list(self.reservations)
        spent_g = self.fuel_g + self.depletion_g
        share = abs(self.soc_correction_g) / spent_g if spent_g else np.inf
        if self.soc_correction_g and share > COMPARABLE_SHARE:
            and_charge = " and of what the battery was to give" if self.depletion_g else ""
            found.append(
                f"the correction for its final SOC is {100.0 * share:.3g} % of its fuel"
                f"{and_charge}, more than {100.0 * COMPARABLE_SHARE:g} %"
            )
        left = sentence(self.vehicle, self.trajectory, self.excess)
        if left:
            found.append(left)
        rungs = self.trajectory.fallback
        fallback = sum(1 for rung in rungs if rung)
        if fallback > MOSTLY * len(rungs):
            found.append(f"fallbacks drove in {fallback} of {len(rungs)} s")
        return found

    @property
    def comparable(self) -> bool:
        """Whether final SOC, limits and fallbacks allow a fair comparison of fuel."""
        return not self.not_comparable

    def summary(self) -> dict[str, Any]:
        """Return the figures of the run as plain data, ready for JSON.

        `violations` holds the largest excess over each limit, 0 if none; figures that a controller
        does not have (its relaxation gap, say) are null.
        """
        tr, excess, reasons = self.trajectory, self.excess, self.not_comparable
        step_ms = tr.step_time_s[np.isfinite(tr.step_time_s)] * 1e3
        share = tr.on_share[np.isfinite(tr.on_share)]
        integral = (share < INTEGRAL) | (share > 1.0 - INTEGRAL)
        return {
            "cycle": self.cycle,
            "controller": self.controller,
            "vehicle": self.vehicle.name,
            "distance_km": self.distance_km,
            "fuel_g": self.fuel_g,
            "fuel_soc_balanced_g": self.fuel_soc_balanced_g,
            "comparable": not reasons,
            "soc_init": float(tr.soc[0]),
            "soc_end": float(tr.soc[-1]),
            "soc_min": float(tr.soc.min()),
            "soc_max": float(tr.soc.max()),
            "t_cl_min_degc": float(tr.t_cl_degc.min()),
            "t_cl_max_degc": float(tr.t_cl_degc.max()),
            "t_cl_end_degc": float(tr.t_cl_degc[-1]),
            "engine_starts": int(tr.started.sum()),
            "engine_on_share": float(tr.engine_on.mean()),
            "violations": {
                "soc": float(excess.soc.max()),
                "t_cl_degc": float(excess.t_cl_k.max()),
                "power_w": float(excess.power_w.max()),
            },
            "fallback_steps": sum(1 for rung in tr.fallback if rung),
            "relaxation_gap": _max_and_mean(tr.relaxation_gap),
            "sigma_integral_share": float(integral.mean()) if len(share) else None,
            "step_time_ms": {
                "median": float(np.median(step_ms)) if len(step_ms) else None,
                "p99": float(np.percentile(step_ms, 99)) if len(step_ms) else None,
                "max": _max(step_ms),
            },
            "solver": {
                "name": self.solver or None,
                "implementation": self.implementation,
                "iterations_max": int(tr.iterations.max()) if self.solver else None,
                "iterations_median": float(np.median(tr.iterations)) if self.solver else None,
            },
            "remarks": [
                *self.remarks,
                *(f"{self.controller} on {self.cycle}: not comparable: {why}" for why in reasons),
                *filter(None, [self.doubt]),
            ],
            "flags": flag_seconds(tr.flags),
            **run_figures(self.vehicle.engine, tr.engine_on, self.distance_km),
            "friction_brake_j": float(tr.p_friction_w.sum()) * STEP_S,
            "fuel_expected_g": self.fuel_expected_g,
            "fuel_off_expected_percent": self.fuel_off_expected_percent,
            "soc_end_target": self.soc_target,
            "soc_end_at_least": self.vehicle.trip.soc_end_at_least,
            "battery_used_kwh": self.battery_used_j / J_PER_KWH,
            "certificate_g": _max_and_mean(tr.certificate_g),
            "soc_price_g": self.soc_price_g,
            **({} if self.faults is None else {"faults": self.faults}),
            **({} if self.plant is None else {"plant": self.plant}),
            **({"figures": dict(self.figures)} if self.figures else {}),
        }


INTEGRAL = 0.02  # an on-share within this of 0 or 1 counts as integral


def flag_seconds(flags: NDArray[np.int64]) -> dict[str, int]:
    """Return for how many seconds each flag was raised, for those that were."""
    seconds = {flag: int(np.count_nonzero(flags & flag)) for flag in Flag}
    return {name: count for flag, count in seconds.items() if count for name in flag.names()}


def _max_and_mean(values: Floats) -> dict[str, float | None]:
    """Of the finite ones; None without any."""
    known = values[np.isfinite(values)]
    return {"max": _max(known), "mean": float(known.mean()) if len(known) else None}


def _max(values: Floats) -> float | None:
    return float(values.max()) if len(values) else None


def soc_price_of(optimum: Run | None) -> float | None:
    """What final SOC is worth by this run of `dp`; None without one, and on a foreign plant."""
    return None if optimum is None or optimum.plant is not None else optimum.soc_price_g


def balanced_g(run: Run, optimum: Run | None) -> float:
    """SOC-balanced fuel at the price of this run of `dp`, or without one at `trip.eta_eq`."""
    price_g = soc_price_of(optimum)
    return run.fuel_soc_balanced_g if price_g is None else run.fuel_balanced_at_g(price_g)


def compare_runs(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """Return the summary of each run, compared with the others on its cycle.

    saving_vs_rule_percent = 100 (1 - m / m_rule),   fuel_above_dp_percent = 100 (m / m_dp - 1)

    with m the SOC-balanced fuel. Null where there is no such run on the cycle, or it burns
    nothing. Where `dp` is among them m is `fuel_soc_balanced_dp_g`, its final SOC at the price that
    dynamic programming found, else `fuel_soc_balanced_g`. `comparable` of a run tells whether its
    own m can be trusted (see `Run`). On a foreign plant, where that price is none, there is also
    saving_vs_own_control_percent, with the run of that plant's own control.
    """
    optima = {run.cycle: run for run in runs if run.controller == OPTIMUM}
    balanced = {(run.cycle, run.controller): balanced_g(run, optima.get(run.cycle)) for run in runs}

    rows = []
    for run in runs:
        fuel_g = balanced[run.cycle, run.controller]
        priced = soc_price_of(optima.get(run.cycle)) is not None
        share = {
            other: fuel_g / balanced[run.cycle, other]
            for other in (REFERENCE, OPTIMUM)
            if balanced.get((run.cycle, other), 0.0) > 0.0
        }
        rule, optimum = share.get(REFERENCE), share.get(OPTIMUM)
        against_own = {}
        if run.plant is not None:
            own_g = balanced.get((run.cycle, run.plant["name"]), 0.0)
            percent = 100.0 * (1.0 - fuel_g / own_g) if own_g > 0.0 else None
            against_own["saving_vs_own_control_percent"] = percent
        rows.append(
            {
                **run.summary(),
                "fuel_soc_balanced_dp_g": fuel_g if priced else None,
                "saving_vs_rule_percent": None if rule is None else 100.0 * (1.0 - rule),
                "fuel_above_dp_percent": None if optimum is None else 100.0 * (optimum - 1.0),
                **against_own,
            }
        )
    return rows
