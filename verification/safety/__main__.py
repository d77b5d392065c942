"""``python -m qpmpc.verification.safety``: random trips, or hostile seconds, and the outcome."""

import argparse
import sys
from collections import Counter
from typing import Any

from rich.progress import track

from qpmpc.files import json_text
from qpmpc.trip import Trip
from qpmpc.vehicle import vehicle_names
from qpmpc.verification.safety.hostile import hostile_drive
from qpmpc.verification.safety.random_trips import Outcome, outcomes

CYCLE = "nycc"


def trips(count: int, seed: int) -> dict[str, Any]:
    """Drive random trips with `mh-qp` and count what went wrong, by cause of the forecast."""
    found: Counter[str] = Counter()
    worst: list[dict[str, Any]] = []
    for one in track(outcomes(range(seed, seed + count)), "trips", count, transient=True):
        found.update(_counts(one))
        if one.row is not None and one.row["violations"]["t_cl_degc"] > 0.0:
            worst.append(
                {
                    "seed": one.seed,
                    "vehicle": one.vehicle,
                    "forecast": one.forecast,
                    "t_cl_min_degc": one.row["t_cl_min_degc"],
                    "t_cl_max_degc": one.row["t_cl_max_degc"],
                    "violation_k": one.row["violations"]["t_cl_degc"],
                }
            )
    worst.sort(key=lambda each: -float(each["violation_k"]))
    return {"trips": count, "first_seed": seed, **dict(sorted(found.items())), "coolant": worst}


def _counts(one: Outcome) -> list[str]:
    if one.row is None:
        return ["failed"]
    of_limit = {"soc": "SOC violated", "power_w": "power violated", "t_cl_degc": "coolant violated"}
    names = [name for key, name in of_limit.items() if one.row["violations"][key] > 0.0]
    kind = "true forecast" if one.forecast == "true" else "wrong forecast"
    return [kind, *names, *(f"{name}, {kind}" for name in names if name.startswith("coolant"))]


def hostile(steps: int, seed: int) -> dict[str, Any]:
    """Drive hostile seconds, each car the same number, C and Python side by side."""
    result = {}
    for name in vehicle_names():
        found = hostile_drive(Trip(CYCLE, name), steps, seed)
        result[name] = {
            "steps": found.steps,
            "planned": found.planned,
            "flags": dict(found.flags),
            "rungs": dict(found.rungs),
            "faults": found.faults,
            "avoidable": dict(zip(("power_w", "soc", "t_cl_k"), found.avoidable, strict=True)),
        }
    return result


def main() -> None:
    """Parse the arguments, run, print JSON."""
    program = "python -m qpmpc.verification.safety"
    parser = argparse.ArgumentParser(prog=program, description=__doc__)
    parser.add_argument("what", choices=["trips", "hostile"])
    parser.add_argument("--count", type=int, default=100, help="trips, or seconds of each car")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    run = trips if given.what == "trips" else hostile
    sys.stdout.write(json_text(run(given.count, given.seed)))


if __name__ == "__main__":
    main()
