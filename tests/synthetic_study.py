"""Tables of studies with known truths, seeded: what the engine of studies would return."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pandas import DataFrame

SHIFT_PERCENT = 0.4  # median fuel above dp of the studied controller
SCALE = 0.6  # of its logarithm: a lognormal distribution


@dataclass(frozen=True)
class Study:
    name: str = "winter trips"
    description: str = "How far is mh-qp from the optimum on trips that nobody tuned on?"
    seed: int = 1
    runs: int = 0
    text: str = 'name = "winter trips"\n'
    varied: Sequence[str] = ("cycle", "seed", "set.thermal.t_amb_degc")
    remarks: tuple[str, ...] = ()
    provenance: dict[str, str] = field(default_factory=lambda: {"qpmpc-iptm": "0.1"})


def synthetic(
    trips: int,
    seed: int = 0,
    vehicles: Sequence[str] = ("prius-nimh", "prius-liion"),
    controllers: Sequence[str] = ("rule-based", "mh-qp", "dp"),
    shift: float = 0.0,
    cold: float = 0.01,
) -> tuple[DataFrame, Study]:
    """Every controller on every trip.

    The fuel of mh-qp is above that of dp by SHIFT exp(SCALE z), z normal and the same for the same
    seed, plus `shift` and, for each degree below zero, `cold`, percent. That of the rules is 10 %.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for trip in range(trips):
        vehicle = vehicles[trip % len(vehicles)]
        ambient = float(rng.choice([-15.0, -7.0, 0.0, 10.0]))
        distance, speed = rng.uniform(2.0, 40.0), rng.uniform(20.0, 90.0)
        best = 45.0 * distance * rng.uniform(0.9, 1.1)
        above = SHIFT_PERCENT * np.exp(SCALE * rng.normal()) + shift + cold * max(-ambient, 0.0)
        wall_s = rng.uniform(0.5, 1.5)
        for controller in controllers:
            percent = {"rule-based": 10.0, "dp": 0.0}.get(controller, above)
            fuel = best * (1.0 + percent / 100.0)
            qp = controller not in ("rule-based", "dp")
            rows.append(
                {
                    "run": len(rows),
                    "cycle": f"trip-{trip:05d}",
                    "vehicle": vehicle,
                    "controller": controller,
                    "forecast": "true",
                    "faults": None,
                    "seed": seed + trip,
                    "set.thermal.t_amb_degc": ambient,
                    "set.mh_qp.admm.iterations": 50.0 if qp else None,
                    "error": None,
                    "distance_km": distance,
                    "duration_s": 3600.0 * distance / speed,
                    "fuel_g": fuel,
                    "fuel_soc_balanced_g": fuel,
                    "comparable": True,
                    "engine_starts": int(distance),
                    "engine_on_share": 0.5,
                    "violations.soc": 0.0,
                    "violations.t_cl_degc": 0.0,
                    "violations.power_w": 0.0,
                    "fallback_steps": 0,
                    "step_time_ms.p99": 0.3 if qp else None,
                    "remarks": [],
                    "wall_s": wall_s,
                    "trip_hash": f"{seed}-{trip}",
                    "fuel_above_dp_percent": percent if "dp" in controllers else np.nan,
                    "saving_vs_rule_percent": (
                        100.0 * (1.0 - fuel / (1.1 * best)) if "rule-based" in controllers
                        else np.nan
                    ),
                }
            )  # fmt: skip
    return DataFrame(rows), Study(seed=seed, runs=len(rows))


def failing(frame: DataFrame, runs: Sequence[int], error: str = "the solver broke") -> DataFrame:
    """Return the table with these runs failed: an error and no figures."""
    figures = frame.columns.get_loc("error") + 1
    result = frame.astype(object)
    for run in runs:
        result.iloc[run, figures:] = None
        result.loc[run, "error"] = error
    return result


def planned(study: Study, runs: int) -> Study:
    """Return the study with another number of runs."""
    return replace(study, runs=runs)
