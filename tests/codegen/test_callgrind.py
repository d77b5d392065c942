"""Instructions of every step of a real trip on this machine, counted by callgrind.

The host library drives a cycle on the Python plant. Its inputs are recorded, and the same library
gets them again under callgrind, from a C program that does nothing else.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from numpy.typing import NDArray
from recorded import REPLAY_C, Recorder

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.generate import Precision, project_files
from qpmpc.codegen.host_library import compiled
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.results import Run
from qpmpc.trip import Trip
from qpmpc.vehicle import Vehicle, load_vehicle

TOOLS = {"a C compiler": compiler(), "valgrind": shutil.which("valgrind")}
MISSING = [name for name, found in TOOLS.items() if found is None]
pytestmark = pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")

VEHICLE = load_vehicle()


def counted(
    trip: Cycle,
    overrides: dict[str, object] | None = None,
    vehicle: Vehicle = VEHICLE,
    precision: Precision = "f64",
    name: str = "mh-qp",
) -> tuple[NDArray[np.int64], Run]:
    """Drive a trip; return the instructions of each call of mpc_step, and the run."""
    settings = ControllerSettings().with_settings(overrides or {})
    recorder = Recorder(Trip(trip, vehicle), settings, precision, name)
    project = project_files(recorder.controller.library.values, "host", precision)
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name in project:
            if name.endswith(".h"):
                (folder / name).write_text(project[name])
        (folder / "replay.c").write_text(REPLAY_C)
        build = [compiler(), "-std=c99", "-o", "replay", "replay.c", compiled(project)]
        subprocess.run(build, cwd=folder, check=True)
        replay = subprocess.run(
            [
                "valgrind",
                "--tool=callgrind",
                "--callgrind-out-file=count",
                "--toggle-collect=mpc_step",  # only from its entry to its return
                "--dump-after=mpc_step",  # one file per call: count.1, count.2, ...
                "./replay",
                str(int(settings.mh_qp.prepared)),
            ],
            cwd=folder,
            input=recorder.inputs,
            capture_output=True,
            check=True,
            # else the first step would include looking up the functions of the C library
            env=os.environ | {"LD_BIND_NOW": "1"},
        )
        check_same_commands(recorder, replay.stdout)
        counts = [total(folder / f"count.{k}") for k in range(1, trip.steps + 1)]
    return np.array(counts), recorder.run


def check_same_commands(recorder: Recorder, replayed: bytes) -> None:
    """What is counted is what drove; to a watt, as valgrind does not fuse products everywhere."""
    assert len(replayed) == len(recorder.outputs)
    kind = recorder.controller.library.output_type
    drove, replay = (np.frombuffer(data, dtype=kind) for data in (recorder.outputs, replayed))
    for name in ("engine_on", "rung", "flags", "iterations"):
        np.testing.assert_array_equal(replay[name], drove[name])
    np.testing.assert_allclose(replay["p_eng_w"], drove["p_eng_w"], rtol=0.0, atol=1.0)


def total(file: Path) -> int:
    """Instructions of one of callgrind's files."""
    found = re.search(r"^totals: (\d+)$", file.read_text(), re.MULTILINE)
    assert found, file
    return int(found[1])


@pytest.mark.slow
@pytest.mark.parametrize("t_cl_init_degc", [50.0, 88.0])
def test_instructions_vary_by_less_than_one_percent_over_a_trip(t_cl_init_degc) -> None:
    """Thermostat closed in the whole trip; and open at first, which takes exponentials."""
    vehicle = VEHICLE.with_settings({"trip.t_cl_init_degc": t_cl_init_degc})
    trip = load_cycle("nycc")
    counts, run = counted(trip, vehicle=vehicle)
    is_open = run.trajectory.t_cl_degc[:-1] > vehicle.thermal.thermostat_open_degc
    assert not is_open[-1]
    assert is_open[0] == (t_cl_init_degc == 88.0)
    assert len(counts) == trip.steps
    assert np.ptp(counts) < 0.01 * np.median(counts)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_those_of_costates_vary_by_less_than_one_percent(precision) -> None:
    """To arrival, so with more and more stages masked; the thermostat open at first."""
    vehicle = VEHICLE.with_settings({"trip.t_cl_init_degc": 88.0})
    whole = load_cycle("nycc")
    trip = Cycle.from_samples("part", np.arange(121.0), whole.speed_mps[180:301])
    counts, run = counted(trip, vehicle=vehicle, precision=precision, name="mh-costate")
    assert run.trajectory.engine_on.any()
    assert np.ptp(counts) < 0.01 * np.median(counts)


@pytest.mark.slow
def test_instructions_are_a_fixed_part_a_part_a_stage_and_a_part_a_stage_and_iteration() -> None:
    """I = a + n (b + c K): three small builds give a, b and c, the default build obeys them."""
    whole = load_cycle("nycc")
    trip = Cycle.from_samples("start", whole.time_s[:9], whole.speed_mps[:9])
    horizon = ControllerSettings().mh_qp.horizon
    builds = [(10, 2), (50, 2), (10, 14), (50, 14)]  # iterations K, blocks
    assert horizon.blocks == 14
    rows, instructions = [], []
    for k, blocks in builds:
        size: dict[str, object] = {
            "mh_qp.prepared": False,
            "mh_qp.admm.iterations": k,
            "mh_qp.horizon.blocks": blocks,
        }
        stages = horizon.short_stages + horizon.classes * blocks
        rows.append([1.0, stages, stages * k])
        instructions.append(float(np.median(counted(trip, size)[0])))
    parts = np.linalg.solve(rows[:3], instructions[:3])
    assert (parts > 0.0).all()
    assert instructions[3] == pytest.approx(np.dot(rows[3], parts), rel=0.01)
