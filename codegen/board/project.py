"""The project for a board: a generated controller, a recorded trip, a program that logs it."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Literal

import numpy as np

from qpmpc._version import __version__
from qpmpc.codegen.board.again import (
    LINKER_SCRIPT,
    OF_QEMU,
    OF_YOURS,
    earlier_project,
    is_outgrown,
    memory_map,
    on_edited_script,
    remove_leftovers,
)
from qpmpc.codegen.board.manifest import LONGEST_TRIP_S, NAME, Manifest, digests
from qpmpc.codegen.firmware import ICOUNT_SHIFT
from qpmpc.codegen.generate import (
    Algorithm,
    Precision,
    algorithm_of,
    literals,
    project_files,
    template_text,
    texts_of,
)
from qpmpc.codegen.generate import Target as GeneratedTarget
from qpmpc.codegen.method import Generated, Method
from qpmpc.controllers.base import Progress
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import InputError
from qpmpc.files import check_folder, write_texts
from qpmpc.shown import shown
from qpmpc.trip import Observation, Trip

BoardTarget = Literal["cortex-m7", "linux"]
BOARD_TARGETS: tuple[BoardTarget, ...] = ("cortex-m7", "linux")
GENERATED_FOR: dict[BoardTarget, GeneratedTarget] = {"cortex-m7": "cortex-m7", "linux": "host"}
YOURS = ("replay_port.c", LINKER_SCRIPT)  # edited by the user: kept
PROGRAMS = "board/programs"
NOT_KNOWN_G = -1.0
FLAGS_A_LINE = 30
MHZ_MIN, MHZ_MAX = 1.0, 4000.0


@dataclass(frozen=True)
class Project:
    """A project that was written.

    Attributes
    ----------
    manifest : what it is
    kept : files that were there and are the user's to edit
    remarks : what else is said of a project that was there before
    """

    manifest: Manifest
    kept: list[str]
    remarks: list[str]


def write_project(
    trip: Trip,
    settings: ControllerSettings,
    folder: Path,
    target: BoardTarget = "cortex-m7",
    precision: Precision = "f32",
    algorithm: Algorithm = "admm",
    controller: Generated = "mh-qp",
    seconds: int | None = None,
    clock_mhz: float | None = None,
    progress: Progress | None = None,
) -> Project:
    """Write the project that replays a trip on a board.

    Parameters
    ----------
    trip, settings : the trip, and settings of the controllers
    folder : of the project; `YOURS` are kept if they are there, but for a linker script that
        nobody edited and that another controller outgrows; sources of an earlier project go
    target : a bare Cortex-M7, or Linux
    precision, algorithm, controller : to be generated
    seconds : of the trip to be replayed, from departure on; all if None
    clock_mhz : of the core, for the log
    progress : called as progress(seconds recorded, seconds in all)

    Raises
    ------
    InputError
        If a value is not allowed, the settings do not fit generated code, or the folder holds the
        project of another target.
    """
    count = trip.steps if seconds is None else seconds
    if not 1 <= count <= min(trip.steps, LONGEST_TRIP_S):
        raise InputError(f"--seconds must be 1 to {trip.steps}, the trip's length (given: {count})")
    core_hz = 0 if clock_mhz is None else round(checked_mhz(clock_mhz) * 1e6)
    check_folder(folder, "--project")
    earlier = earlier_project(folder)
    if earlier is not None and earlier.target != target:
        raise InputError(
            f"--project {folder} is for {earlier.target}: use another folder for {target}"
        )
    method = Method.of(controller, settings)
    values = method.values(trip.vehicle, method.horizon.block_count(trip.forecast.steps))
    algorithm = algorithm_of(values, algorithm)
    files = project_files(values, GENERATED_FOR[target], precision, algorithm)
    own = dict(texts_of(PROGRAMS))
    port = own[f"replay_port_{target.replace('-', '_')}.c"]
    files |= {name: text for name, text in own.items() if not name.startswith("replay_port_")}
    record = _record(trip, method, count, progress)
    files["replay_data.c"] = _data(trip, record, precision, values.learning)
    sizes = {"trip_s": trip.steps, "seconds": count, "prepared": method.prepared}
    files["replay_config.h"] = template_text("replay_config.h.j2", **sizes)
    compared = {name: text for name, text in files.items() if _is_compared(name)}
    manifest = Manifest(
        version=__version__,
        target=target,
        controller=controller,
        algorithm=algorithm,
        precision=precision,
        iterations=values.iterations,
        cycle=shown(trip.cycle.name),
        vehicle=values.vehicle,
        prepared=method.prepared,
        power_max_w=trip.vehicle.engine.power_max_w,
        trip_s=trip.steps,
        seconds=count,
        files=digests(compared),
    )
    about = {**manifest.model_dump(), "identity": manifest.identity, "core_hz": core_hz}
    about["icount_shift"] = ICOUNT_SHIFT
    files["replay_identity.h"] = template_text("replay_identity.h.j2", **about)
    files["REPLAY.md"] = template_text("REPLAY.md.j2", **about)
    files["Makefile"] += template_text(f"Makefile.replay-{target}.j2", **about)
    files[NAME] = manifest.text()
    files["replay_port.c"] = port
    if target == "cortex-m7":
        files[LINKER_SCRIPT] = memory_map(algorithm, precision, OF_YOURS)
        files["replay_qemu.ld"] = memory_map(algorithm, precision, OF_QEMU)
    kept = [name for name in YOURS if name in files and (folder / name).exists()]
    remarks = []
    if earlier is not None and LINKER_SCRIPT in kept:
        if is_outgrown(folder, earlier, files[LINKER_SCRIPT]):
            kept.remove(LINKER_SCRIPT)
        elif remark := on_edited_script(earlier, algorithm, precision):
            remarks.append(remark)
    write_texts(folder, {name: text for name, text in files.items() if name not in kept})
    if earlier is not None:
        remarks += remove_leftovers(folder, earlier, files)
    return Project(manifest, kept, remarks)


def checked_mhz(clock_mhz: float) -> float:
    """Return the clock if a core can have it.

    Raises
    ------
    InputError
        If it cannot.
    """
    if not (isfinite(clock_mhz) and MHZ_MIN <= clock_mhz <= MHZ_MAX):
        raise InputError(
            f"--clock-mhz must be {MHZ_MIN:g} to {MHZ_MAX:g}, the core's clock (given: "
            f"{clock_mhz:g})"
        )
    return clock_mhz


def _is_compared(name: str) -> bool:
    """Whether a file decides on commands, and the host compiles it too."""
    is_source = name.endswith((".c", ".h"))
    in_both = name.startswith(("mpc", "osqp/", "replay_inputs", "replay_data", "replay_config"))
    return is_source and (in_both or name == "replay.h")


def _record(
    trip: Trip, method: Method, seconds: int, progress: Progress | None
) -> list[Observation]:
    """Drive in closed loop with the controller in Python; return what it saw."""
    controller = method.twin(trip)
    controller.begin(trip)
    state, record = trip.plant.initial_state(), []
    for step in range(seconds):
        seen = trip.observation(step, state)
        record.append(seen)
        command = controller.decide(seen).command
        state, _ = trip.plant.step(state, command, seen.demand_w, seen.speed_mps)
        if progress is not None:
            progress(step + 1, seconds)
    return record


def _data(trip: Trip, record: list[Observation], precision: Precision, learning: bool) -> str:
    """Return replay_data.c."""
    reals = {
        "demand_w": trip.truth.demand_w,
        "speed_mps": trip.truth.speed_mps,
        "soc": np.array([seen.soc for seen in record]),
        "t_cl_degc": np.array([seen.t_cl_degc for seen in record]),
    }
    if learning:
        reals["fuel_g"] = np.nan_to_num([seen.fuel_g for seen in record], nan=NOT_KNOWN_G)
    of_trip = ("demand_w", "speed_mps")
    arrays = {
        name: (
            "mpc_real",
            "REPLAY_TRIP_S" if name in of_trip else "REPLAY_SECONDS",
            literals(array, precision),
        )
        for name, array in reals.items()
    }
    flags = [str(int(seen.engine_on)) for seen in record]
    cuts = range(0, len(flags), FLAGS_A_LINE)
    rows = [", ".join(flags[i : i + FLAGS_A_LINE]) for i in cuts]
    arrays["engine_on"] = ("uint8_t", "REPLAY_SECONDS", rows)
    return template_text("replay_data.c.j2", arrays=arrays)
