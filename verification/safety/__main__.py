"""``python -m qpmpc.verification.safety``: hostile seconds, and the outcome."""

import argparse
import sys
from typing import Any

from qpmpc.files import json_text
from qpmpc.trip import Trip
from qpmpc.vehicle import vehicle_names
from qpmpc.verification.safety.hostile import hostile_drive

CYCLE = "nycc"


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
    parser.add_argument("--count", type=int, default=1000, help="seconds of each car")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    sys.stdout.write(json_text(hostile(given.count, given.seed)))


if __name__ == "__main__":
    main()
