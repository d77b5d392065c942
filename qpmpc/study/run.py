"""What a worker does: runs of a study, from their parameters to their rows."""

import json
from collections.abc import Sequence
from hashlib import sha256
from io import BytesIO
from time import perf_counter
from typing import Any

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.errors import QpmpcError
from qpmpc.pool import prepare_process
from qpmpc.preview.forecast_errors import forecast
from qpmpc.registry import split_settings
from qpmpc.report.trajectory_csv import trajectory_csv
from qpmpc.results import Run
from qpmpc.shown import shown
from qpmpc.simulation import simulate
from qpmpc.study.columns import FLAGS, SETTING, flat
from qpmpc.study.definition import TRUE_FORECAST, Parameters
from qpmpc.study.identity import code_hash, versions
from qpmpc.study.inputs import Inputs
from qpmpc.trip import Trip
from qpmpc.vehicle import Vehicle

LONGEST_ERROR = 2000  # characters


def rerun(parameters: Parameters, inputs: Inputs) -> Run:
    """Drive a run of a study.

    Raises
    ------
    Whatever makes the run impossible.
    """
    return _drive(parameters, inputs, *_trip(parameters, inputs))


def run_batch(
    code: str, inputs: Inputs, trajectories: bool, batch: Sequence[Parameters]
) -> list[tuple[tuple[dict[str, Any], bytes | None], float]]:
    """Make several runs, in a worker.

    Raises
    ------
    QpmpcError
        If the worker has other code than the process that wants the results.
    """
    if code_hash() != code:
        raise QpmpcError(
            "a worker has other code than this process: install the same version on both"
        )
    prepare_process()
    done = []
    for parameters in batch:
        row, run = row_of(parameters, inputs)
        table = _trajectory_bytes(run) if trajectories and run is not None else None
        done.append(((row, table), float(row["wall_s"])))
    return done


def row_of(parameters: Parameters, inputs: Inputs) -> tuple[dict[str, Any], Run | None]:
    """Drive a run and return its row, by the names of `columns`, and the run if it succeeded.

    Whatever a run raises is no reason to stop a study, nor is a controller that exits: its text is
    the row's `error`.
    """
    run, found = None, _parameters(parameters)
    start = perf_counter()
    try:
        trip, chosen = _trip(parameters, inputs)
        found |= _hashes(parameters, inputs, trip)
        run = _drive(parameters, inputs, trip, chosen)
        found |= _figures(run)
    except (Exception, SystemExit, KeyboardInterrupt) as error:
        name = "" if type(error).__module__.startswith("qpmpc.") else f"{type(error).__name__}: "
        found["error"] = shown(f"{name}{error}")[:LONGEST_ERROR]
    found["wall_s"] = perf_counter() - start
    return found, run


def _trip(parameters: Parameters, inputs: Inputs) -> tuple[Trip, ControllerSettings]:
    of_vehicle, chosen = split_settings(parameters.settings, [parameters.controller])
    cycle = inputs.cycle(parameters.cycle)
    trip = Trip(cycle, inputs.vehicle(parameters.vehicle)).with_settings(of_vehicle)
    if parameters.forecast != TRUE_FORECAST:
        guess = forecast(cycle, trip.believed, parameters.forecast, parameters.seed)
        trip = trip.with_forecast(guess)
    return trip, chosen


def lost_row(parameters: Parameters, reason: str) -> dict[str, Any]:
    """Return the row of a run that its process could not end."""
    return {**_parameters(parameters), "error": reason}


def _drive(parameters: Parameters, inputs: Inputs, trip: Trip, chosen: ControllerSettings) -> Run:
    faults = inputs.faults[parameters.faults] if parameters.faults else None
    return simulate(trip, parameters.controller, settings=chosen, faults=faults)


def _parameters(parameters: Parameters) -> dict[str, Any]:
    found: dict[str, Any] = {
        "run": parameters.run,
        "cycle": parameters.cycle,
        "vehicle": parameters.vehicle,
        "controller": parameters.controller,
        "forecast": parameters.forecast,
        "faults": parameters.faults,
        "seed": parameters.seed,
        "code_hash": code_hash(),
        "versions": versions(),
    }
    return found | {SETTING + key: value for key, value in parameters.settings.items()}


def _hashes(parameters: Parameters, inputs: Inputs, trip: Trip) -> dict[str, str]:
    """Hash the trip (road, vehicle, weather), and all that the run is made from."""
    of_trip = content_hash(trip.cycle, trip.vehicle)
    faults = inputs.faults[parameters.faults] if parameters.faults else ()
    rest = [
        parameters.controller,
        sorted(parameters.settings.items()),
        parameters.forecast,
        parameters.seed if parameters.forecast != TRUE_FORECAST else None,
        [fault.model_dump() for fault in faults],
    ]
    whole = sha256(f"{of_trip} {json.dumps(rest)}".encode())
    return {"trip_hash": of_trip, "inputs_hash": whole.hexdigest()[:32]}


def content_hash(cycle: Cycle, vehicle: Vehicle) -> str:
    """Hash the numbers of a road and a vehicle."""
    digest = sha256(vehicle.model_dump_json().encode())
    digest.update(cycle.speed_mps.tobytes())
    digest.update(cycle.grade.tobytes())
    return digest.hexdigest()[:32]


def _figures(run: Run) -> dict[str, Any]:
    summary = run.summary()
    for name in ("cycle", "controller", "vehicle"):
        del summary[name]  # as the study names them
    effect = summary.pop("faults", None)
    found = {**dict.fromkeys(FLAGS, 0), **flat(summary)}
    found["duration_s"] = len(run.trajectory.fuel_g)
    found["faults_effect"] = None if effect is None else json.dumps(effect)
    return found


def _trajectory_bytes(run: Run) -> bytes:
    """Return a trajectory as a Parquet file, with the columns of its CSV file."""
    import pyarrow.csv as csv
    import pyarrow.parquet as parquet

    into = BytesIO()
    table = csv.read_csv(BytesIO(trajectory_csv(run).encode()))
    parquet.write_table(table, into, compression="zstd")
    return into.getvalue()
