"""Whole trips and their corners in C under sanitizers, with the commands of the same library.

A sample here; all cycles, both cars, both precisions by

    PYTHONPATH=tests python tests/codegen/test_sanitized_trips.py
"""

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from c_project import SANITIZERS, build, make_project, need
from recorded import REPLAY_C, Recorder

from qpmpc.codegen.generate import PRECISIONS, Precision
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, cycle_names, load_cycle
from qpmpc.trip import Trip
from qpmpc.vehicle import Vehicle, load_vehicle, vehicle_names

ARCTIC: dict[str, object] = {
    "thermal.t_amb_degc": -40.0,
    "thermal.cabin_heat_w": 4000.0,
    "trip.t_cl_init_degc": -40.0,
}
CORNERS: list[tuple[int, dict[str, object]]] = [
    (1, {}),
    (2, {}),
    (20, {}),
    (60, {"trip.soc_init": 0.4}),
    (60, {"trip.soc_init": 0.79}),
    (60, {"trip.t_cl_init_degc": 40.0}),
    (60, {"trip.t_cl_init_degc": 90.0}),
    (60, ARCTIC),
    (60, {"thermal.radiator_w_per_k": 0.0}),
]


def part(name: str, first: int, steps: int) -> Cycle:
    whole = load_cycle(name)
    last = min(first + steps, whole.steps) + 1
    return Cycle.from_samples(name, whole.time_s[first:last] - first, whole.speed_mps[first:last])


def replay(cycle: Cycle, vehicle: Vehicle, precision: Precision, prepared: bool) -> int:
    """Drive, then replay the inputs under sanitizers; returns the seconds."""
    settings: dict[str, object] = {"mh_qp.prepared": prepared, "mh_qp.horizon.blocks": 7}
    recorder = Recorder(
        Trip(cycle, vehicle), ControllerSettings().with_settings(settings), precision
    )
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        make_project(folder, precision, vehicle=vehicle, settings=settings)
        (folder / "replay.c").write_text(REPLAY_C)
        flags = f"-std=c99 -O1 -g -ffp-contract=off {SANITIZERS} -fno-sanitize-recover=all"
        build(folder, "gcc", flags, "replay", "replay.c")
        command = ["./replay", str(int(prepared))]
        done = subprocess.run(command, cwd=folder, input=recorder.inputs, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    kind = recorder.controller.library.output_type
    drove, replayed = (np.frombuffer(data, dtype=kind) for data in (recorder.outputs, done.stdout))
    assert len(replayed) == len(drove) == cycle.steps
    for name in ("engine_on", "rung", "flags", "iterations"):
        np.testing.assert_array_equal(replayed[name], drove[name])
    np.testing.assert_allclose(replayed["p_eng_w"], drove["p_eng_w"], rtol=0.0, atol=1.0)
    return cycle.steps


@pytest.mark.slow
@pytest.mark.parametrize(
    ("corner", "precision"), [(0, "f64"), (2, "f32"), (3, "f32"), (6, "f64"), (7, "f32")]
)
def test_corners_are_clean_under_sanitizers(corner, precision) -> None:
    need("gcc")
    steps, overrides = CORNERS[corner]
    vehicle = load_vehicle().with_settings(overrides)
    assert replay(part("nycc", 0, steps), vehicle, precision, prepared=False) == steps


@pytest.mark.slow
def test_seconds_of_a_trip_with_departure_are_clean_under_sanitizers() -> None:
    need("gcc")
    replay(part("nycc", 200, 50), load_vehicle("prius-liion"), "f32", prepared=True)


if __name__ == "__main__":
    for precision in PRECISIONS:
        for car in vehicle_names():
            for name in cycle_names():
                steps = replay(load_cycle(name), load_vehicle(car), precision, prepared=True)
                print(f"{precision} {car} {name}: {steps} s clean", flush=True)
            for seconds, overrides in CORNERS:
                vehicle = load_vehicle(car).with_settings(overrides)
                replay(part("nycc", 0, seconds), vehicle, precision, prepared=True)
                print(f"{precision} {car} {seconds} s {overrides}: clean", flush=True)
