"""Random trips through hills and winter, on which a controller has to keep its limits."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from qpmpc.closed_loop import drive
from qpmpc.controllers.mh_qp import MhQp
from qpmpc.cycles import Cycle, cycle_names, load_cycle
from qpmpc.preview.forecast_errors import MODELS, forecast
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle, vehicle_names
from qpmpc.verification.independent.equations import Floats

MOST_PARTS = 2
STEEPEST = 0.07
HILL_M = (200.0, 3000.0)  # shortest and longest wave of the profile
PLAIN_SHARE, TRUE_SHARE = 0.25, 0.3  # trips without hills, and with a true forecast


@dataclass(frozen=True)
class Outcome:
    """One trip: what it was and what came of it.

    Attributes
    ----------
    seed : that makes it again
    row : JSON of the run; None where it failed
    error : why it failed
    """

    seed: int
    steps: int
    vehicle: str
    settings: dict[str, float]
    forecast: str
    row: dict[str, Any] | None
    error: str = ""


def random_trip(seed: int) -> tuple[Trip, dict[str, float], str]:
    """Return a trip, the settings that make its vehicle, and the name of its forecast error."""
    rng = np.random.default_rng(seed)
    settings = {
        "thermal.t_amb_degc": rng.uniform(-20.0, 10.0),
        "thermal.cabin_heat_w": rng.uniform(500.0, 4000.0),
        "battery.aux_power_w": rng.uniform(200.0, 2000.0),
        "trip.soc_init": rng.uniform(0.41, 0.79),
        "trip.t_cl_init_degc": rng.uniform(40.5, 89.0),
    }
    vehicle = load_vehicle(str(rng.choice(vehicle_names()))).with_settings({**settings})
    cycle = _cycle(rng, f"random-{seed}")
    kind = "true"
    said = None
    if rng.random() > TRUE_SHARE:
        kind = str(rng.choice(list(MODELS)))
        said = forecast(cycle, vehicle, kind, seed)
    return Trip(cycle, vehicle, said), settings, kind


def drive_one(seed: int) -> Outcome:
    """Make a trip and drive it; in Python, so that no car needs a library of its own."""
    trip, settings, kind = random_trip(seed)
    row, error = None, ""
    try:
        row = drive(trip, MhQp(trip)).summary()
    except Exception as failure:  # the study goes on, and counts it
        error = f"{type(failure).__name__}: {failure}"
    return Outcome(seed, trip.steps, trip.vehicle.name, settings, kind, row, error)


def _cycle(rng: np.random.Generator, name: str) -> Cycle:
    parts = [load_cycle(str(c)) for c in rng.choice(cycle_names(), rng.integers(1, MOST_PARTS + 1))]
    speed = np.concatenate([parts[0].speed_mps, *(part.speed_mps[1:] for part in parts[1:])])
    grade = np.zeros(len(speed))
    if rng.random() > PLAIN_SHARE:
        grade = _hills(rng, speed)
    return Cycle(name, np.arange(len(speed), dtype=float), speed, grade)


def _hills(rng: np.random.Generator, speed_mps: Floats) -> Floats:
    """A sum of sines over the way, with a slope all along now and then; steepest as drawn."""
    way = np.cumsum(speed_mps)
    grade = np.zeros(len(way))
    for _ in range(4):
        wave = float(np.exp(rng.uniform(*np.log(HILL_M))))
        grade += rng.normal() * np.sin(2.0 * np.pi * way / wave + rng.uniform(0.0, 6.3))
    grade += rng.normal() * (rng.random() < 0.3)
    return grade / max(float(np.abs(grade).max()), 1e-9) * rng.uniform(0.01, STEEPEST)


def outcomes(seeds: range) -> Iterator[Outcome]:
    """Drive trips in as many processes as there are processors."""
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor() as pool:
        yield from pool.map(drive_one, seeds, chunksize=1)
