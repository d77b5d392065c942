"""The project for a board: on this machine and on QEMU's Cortex-M7, its log read and checked."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from browser import assert_works
from c_project import need, run
from pages import assert_self_contained

from qpmpc.cli.board import read as read_board
from qpmpc.codegen.board.check import BoardResult, check_log
from qpmpc.codegen.board.project import BoardTarget, write_project
from qpmpc.codegen.board.report import board_lines, board_rows, write_board
from qpmpc.codegen.firmware import make_firmware, missing_tools, symbols
from qpmpc.codegen.generate import Precision
from qpmpc.codegen.method import Generated
from qpmpc.codegen.pil.loop import processor_in_the_loop
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.trip import Trip

SECONDS = 60
WHOLE = load_cycle("nycc")
CYCLE = Cycle.from_samples("nycc", WHOLE.time_s[: SECONDS + 1], WHOLE.speed_mps[: SECONDS + 1])
QUICK = ControllerSettings().with_settings({"mh_qp.admm.cold_iterations": 400})
EMBEDDED = Path(__file__).parents[2] / "docs" / "embedded.md"
BLOCKS = re.findall(r"^```bash\n(.*?)^```", EMBEDDED.read_text("utf-8"), re.MULTILINE | re.DOTALL)
MISSING = missing_tools()
needs_qemu = pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")


def made(
    folder: Path,
    target: BoardTarget,
    precision: Precision,
    controller: Generated,
    settings: ControllerSettings = QUICK,
    **options: float,
) -> Path:
    write_project(
        Trip(CYCLE), settings, folder, target, precision, controller=controller, **options
    )
    # optimised less than the library of the check: quick to compile, and the same bits
    built = run(folder, "make", "-s", "replay", "CFLAGS=-O1")
    assert (built.returncode, built.stderr) == (0, "")
    return folder


def logged(folder: Path) -> Path:
    """The log of a project on this machine."""
    done = run(folder, "./replay")
    assert (done.returncode, done.stderr) == (0, "")
    (folder / "board.log").write_text(done.stdout, newline="")
    return folder / "board.log"


@pytest.fixture(scope="module")
def linux(tmp_path_factory) -> Path:
    need("make", "cc")
    return made(tmp_path_factory.mktemp("linux"), "linux", "f32", "mh-qp")


@pytest.fixture(scope="module")
def result(linux) -> BoardResult:
    return check_log(linux, logged(linux))


def test_this_machine_as_the_board_gives_the_same_bits(result) -> None:
    data = result.summary()
    assert (data["board"].split()[0], data["unit"], data["clock_mhz"]) == ("linux", "ns", None)
    assert data["commands"]["equal_to_the_bit"] == data["seconds"] == SECONDS
    assert data["commands"]["differ_by_more"] == []
    on = data["commands"]["engine_on_seconds"]  # there is something to compare
    assert data["commands"]["engine_on_equal_to_the_bit"] == on > 0
    assert data["fallback_seconds"] == data["flagged_seconds"] == 0
    step = data["times"]["step"]
    assert 0 < step["min"] <= step["median"] <= step["p99"] <= step["max"]
    assert step["max_ms"] == pytest.approx(step["max"] * 1e-6)
    assert step["max_share_of_second_percent"] == pytest.approx(step["max"] * 1e-7)
    assert data["stack_bytes"] is None


@pytest.mark.parametrize("learning", [False, True])
def test_costates_and_learning_in_double_precision(tmp_path, learning) -> None:
    need("make", "cc")
    name: Generated = "mh-qp" if learning else "mh-costate"
    settings = QUICK.with_settings({"mh_qp.learning": learning, "mh_qp.prepared": not learning})
    folder = made(tmp_path, "linux", "f64", name, settings, seconds=30)
    data = check_log(folder, logged(folder)).summary()
    assert data["commands"]["equal_to_the_bit"] == data["seconds"] == 30
    assert data["trip_s"] == SECONDS
    # five times 30 rounds, by four at a time
    assert data["departure"]["slices"] == (0 if learning else 40)
    # without a departure the rules drive at first
    assert data["fallback_seconds"] == (4 if learning else 0)


def test_what_is_written_has_the_figures(result, tmp_path) -> None:
    data = result.summary()
    assert any("equal this machine's to the bit" in line for line in board_lines(data))
    (remark,) = write_board(result, tmp_path)
    assert remark.endswith("written")
    page = (tmp_path / "board_nycc_mh-qp_f32.html").read_text()
    assert_self_contained(page)
    for cell in (cell for row in board_rows(data) for cell in row):
        assert cell in page
    rows = (tmp_path / "board_nycc_mh-qp_f32.csv").read_text().splitlines()
    assert len(rows) == 1 + SECONDS
    assert rows[1].startswith(f"0,{result.log.step[0]},")
    assert_works(tmp_path / "board_nycc_mh-qp_f32.html", charts=1, tables=1)


def test_a_board_that_computes_something_else_is_found(linux, tmp_path) -> None:
    """As after a fault in memory, or another compiler's: one number of the record is changed."""
    copy = tmp_path / "copy"
    shutil.copytree(linux, copy)
    record = copy / "replay_data.c"
    begin, soc, rest = re.split(r"(replay_soc\[REPLAY_SECONDS\] = \{\n\s+)", record.read_text())
    record.write_text(begin + soc + rest.replace("0.6f", "0.45f", 1))
    assert run(copy, "make", "-s", "replay", "CFLAGS=-O1").returncode == 0
    with pytest.raises(InputError, match=r"second \d+: the board (commands|says)"):
        check_log(linux, logged(copy))
    # and this machine does not replay a record that was changed
    with pytest.raises(InputError, match=r"replay_data\.c is not as it was written"):
        check_log(copy, copy / "board.log")


def test_the_log_of_another_project_is_refused(linux, tmp_path) -> None:
    write_project(Trip(CYCLE), QUICK, tmp_path, "linux", "f32", seconds=30)
    with pytest.raises(InputError, match=r"another program .* 60 s, not .* 30 s"):
        check_log(tmp_path, linux / "board.log")


def test_the_json_does_not_overwrite_what_is_read(linux) -> None:
    log = linux / "board.log"
    before = log.read_bytes()
    for name in ("board.log", "replay.toml"):
        with pytest.raises(InputError, match="would overwrite what is read"):
            read_board(linux, log, None, linux / name, None)
    assert log.read_bytes() == before


def test_ports_are_kept_and_targets_do_not_mix(tmp_path) -> None:
    trip = Trip(CYCLE)
    first = write_project(trip, QUICK, tmp_path, seconds=2)
    assert first.kept == []
    (tmp_path / "replay_port.c").write_text("mine")
    (tmp_path / "mpc.h").write_text("edited")  # no reason not to make it again
    again = write_project(trip, QUICK, tmp_path, seconds=3, clock_mhz=216)
    assert again.kept == ["replay_port.c", "replay.ld"]
    assert (tmp_path / "replay_port.c").read_text() == "mine"
    assert "REPLAY_CORE_HZ 216000000u" in (tmp_path / "replay_identity.h").read_text()
    with pytest.raises(InputError, match="is for cortex-m7"):
        write_project(trip, QUICK, tmp_path, "linux")


def test_another_controller_in_the_same_folder_leaves_nothing_of_the_first(tmp_path) -> None:
    """No source that a vendor's project would take in, no memory that is too small."""
    trip, mh_qp = Trip(CYCLE), {"seconds": 2, "precision": "f64"}
    write_project(trip, QUICK, tmp_path, controller="mh-costate", seconds=2)
    assert [*tmp_path.glob("mpc_costate_*.c")]
    (tmp_path / "mpc_costate_aim.c").write_text("mine")
    again = write_project(trip, QUICK, tmp_path, **mh_qp)
    assert again.kept == ["replay_port.c"]
    (remark,) = again.remarks
    assert remark.startswith("mpc_costate_aim.c is of the project that was here before, edited")
    write_project(trip, QUICK, tmp_path / "new", **mh_qp)
    new = {path.name: path.read_text() for path in (tmp_path / "new").iterdir()}
    here = {path.name: path.read_text() for path in tmp_path.iterdir() if path.is_file()}
    assert here == new | {"mpc_costate_aim.c": "mine"}
    script = (tmp_path / "replay.ld").read_text().replace("LENGTH = 2048K", "LENGTH = 1024K")
    (tmp_path / "replay.ld").write_text(script)
    again = write_project(trip, QUICK, tmp_path, controller="mh-costate", seconds=2)
    assert again.kept == ["replay_port.c", "replay.ld"]
    assert again.remarks == [
        "replay.ld was written for admm in f64 and edited: replay_qemu.ld has what costate in f32 "
        "needs, 64 KB of RAM; take over what differs"
    ]
    assert (tmp_path / "replay.ld").read_text() == script


@pytest.mark.parametrize("name", ["../mpc.c", "/mpc.c", "osqp/../../mpc.c", "mpc.py"])
def test_a_project_that_names_files_elsewhere_is_refused(tmp_path, name) -> None:
    write_project(Trip(CYCLE), QUICK, tmp_path, "linux", controller="mh-costate", seconds=1)
    manifest = tmp_path / "replay.toml"
    manifest.write_text(manifest.read_text().replace('"mpc.h"', f'"{name}"'))
    with pytest.raises(InputError, match="is no name of a source"):
        write_project(Trip(CYCLE), QUICK, tmp_path, "linux", seconds=1)


def test_the_same_settings_give_the_same_identity_on_every_board(tmp_path) -> None:
    trip = Trip(CYCLE)
    kinds: list[tuple[BoardTarget, Precision]] = [
        ("cortex-m7", "f32"),
        ("linux", "f32"),
        ("linux", "f64"),
    ]
    found = [
        write_project(trip, QUICK, tmp_path / str(k), *kind, seconds=5).manifest.identity
        for k, kind in enumerate(kinds)
    ]
    assert found[0] == found[1] != found[2]


def documented(folder: Path, marker: str) -> Path:
    """Run the commands of the block of docs/embedded.md that names `marker`, as they stand."""
    (block,) = [text for text in BLOCKS if marker in text]
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "equal this machine's to the bit" in done.stdout
    return folder


def test_the_documented_blocks_are_those_tried_here() -> None:
    assert len(BLOCKS) == 2


@pytest.mark.slow
def test_the_documented_steps_for_linux_work(tmp_path) -> None:
    need("make", "cc", "bash")
    documented(tmp_path, "--target linux")
    pages = [path.suffix for path in (tmp_path / "results" / "board").iterdir()]
    assert sorted(pages) == [".csv", ".html", ".json", ".png"]


@needs_qemu
@pytest.mark.slow
def test_the_documented_steps_for_a_cortex_m7_work_in_qemu(tmp_path, monkeypatch) -> None:
    """And count what processor in the loop counts."""
    need("bash")
    folder = documented(tmp_path, "qemu.log") / "my_board"
    found = check_log(folder, folder / "qemu.log")
    data = found.summary()
    assert (data["board"], data["unit"]) == ("mps2-an500 in QEMU", "instructions")
    assert "this is no time on silicon" in board_lines(data)[-1]
    assert data["times"]["step"]["max_ms"] is None
    assert data["commands"]["differ_by_more"] == []
    assert 400 < data["stack_bytes"] < 2048
    assert data["flash_bytes"] < 64 * 1024  # the trip in it
    assert data["ram_bytes"] < 64 * 1024  # what replay.ld gives it
    # the same objects, with the firmware's main
    elf = make_firmware(folder)
    monkeypatch.setattr("qpmpc.codegen.pil.loop.build_firmware", lambda *_: elf)
    # and the same trip, second by second: another trip's data take some tens of instructions more
    # (docs/timing.md), the two mains themselves fewer than twenty
    counted = processor_in_the_loop(Trip(WHOLE), controller="mh-costate").instructions
    assert found.log.step == pytest.approx(counted[: found.log.step.size], abs=20)


@needs_qemu
def test_a_project_for_silicon_builds_with_its_clock_and_without_printf(tmp_path) -> None:
    folder = made(tmp_path, "cortex-m7", "f32", "mh-costate", seconds=5, clock_mhz=480)
    names = symbols(folder / "replay.elf")
    assert {"replay_run", "mpc_step", "port_ticks"} <= set(names)
    assert not [name for name in names if re.search("malloc|printf|sbrk|__aeabi_d", name)]
    disassembler = ("arm-none-eabi-objdump", "-d", "--disassemble=port_ticks", "replay.elf")
    assert "e000100" in run(folder, *disassembler).stdout  # DWT_CYCCNT, not QEMU's timer
    # in a vendor's project the port needs neither our start-up nor our linker script
    cpu = ["-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard"]
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-DREPLAY_VENDOR=1"]
    vendor = ["arm-none-eabi-gcc", *cpu, *flags, "-c", "-o", "vendor.o", "replay_port.c"]
    assert run(folder, *vendor).stderr == ""
    alone = set(symbols(folder / "vendor.o"))
    assert "port_start" in alone
    assert not [name for name in alone if name.startswith(("link_", "board_", "main"))]


def test_an_arm_board_with_linux_gives_the_bits_of_this_machine(tmp_path) -> None:
    need("make", "cc", "aarch64-linux-gnu-gcc", "qemu-aarch64")
    write_project(Trip(CYCLE), QUICK, tmp_path, "linux", "f32", seconds=30)
    cross = run(tmp_path, "make", "-s", "replay", "CC=aarch64-linux-gnu-gcc -static")
    assert cross.returncode == 0, cross.stderr
    done = run(tmp_path, "qemu-aarch64", "./replay")
    (tmp_path / "board.log").write_text(done.stdout, newline="")
    data = check_log(tmp_path, tmp_path / "board.log").summary()
    assert data["board"] == "linux aarch64"
    assert data["commands"]["equal_to_the_bit"] == 30
