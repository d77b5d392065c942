"""One more vehicle: numbers compiled alone, once for all processes, and closed after use."""

import gc
import os
import shutil
import subprocess
import sys
import time
from fcntl import LOCK_EX, flock
from pathlib import Path

import pytest

from qpmpc import remarks
from qpmpc.codegen import host_library, library_cache
from qpmpc.codegen.c_compiler import CodegenError, common_object, compiler, library_of
from qpmpc.codegen.controller import GeneratedController
from qpmpc.codegen.generate import project_files
from qpmpc.codegen.host_library import HostLibrary, build_host_library, compiled
from qpmpc.codegen.library_cache import kept_file
from qpmpc.codegen.values import Values, values_of
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")
needs_maps = pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="no /proc")

SETTINGS = ControllerSettings()
KEY = "0" * 24
SMALL = {"mpc_data.c": "int two = 2;\n", "one.c": "extern int two;\nint f(void) { return two; }\n"}


def numbers(name: str = "prius-nimh", **settings: object) -> Values:
    vehicle = load_vehicle(name).with_settings(
        {key.replace("__", "."): value for key, value in settings.items()}
    )
    return values_of(vehicle, SETTINGS.mh_qp, SETTINGS.rule_based, blocks=7)


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """Where the cache will be."""
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache" / "compiled"


class Compiler:
    """The compiler behind a wrapper that notes its calls, and may refuse to make objects."""

    def __init__(self, place: Path) -> None:
        self.command, self._log, self._refuse = place / "wrapper", place / "log", place / "refuse"
        self.command.write_text(
            f'#!/bin/sh\necho "$@" >> {self._log}\n'
            f'[ -e {self._refuse} ] && case " $* " in *" -r "*) exit 1;; esac\n'
            f'exec {compiler()} "$@"\n'
        )
        self.command.chmod(0o755)

    def makes_no_objects(self) -> None:
        self._refuse.touch()

    @property
    def sources(self) -> list[list[str]]:
        """Sources of each compilation so far."""
        lines = self._log.read_text().splitlines()
        calls = [line.split() for line in lines if "--version" not in line]
        return [[word for word in call if word.endswith(".c")] for call in calls]


@pytest.fixture
def calls(tmp_path, monkeypatch) -> Compiler:
    made = Compiler(tmp_path)
    monkeypatch.setenv("CC", str(made.command))
    return made


def mapped(file: Path) -> int:
    return Path("/proc/self/maps").read_text().count(str(file))


def only(folder: Path, suffix: str) -> Path:
    (file,) = folder.glob(f"*{suffix}")
    return file


@pytest.mark.slow
@pytest.mark.parametrize(("command", "precision"), [("gcc", "f64"), ("clang", "f32")])
def test_commands_are_those_of_a_full_compilation_bit_by_bit(command, precision, tmp_path) -> None:
    found = shutil.which(command)
    if found is None:
        pytest.skip(f"no {command} on this machine")
    values = numbers(thermal__t_amb_degc=-11.5)
    files = project_files(values, "host", precision)
    (tmp_path / "common.o").write_bytes(common_object(found, files))
    (tmp_path / "full.so").write_bytes(library_of(found, files))
    (tmp_path / "quick.so").write_bytes(library_of(found, files, tmp_path / "common.o"))
    trip = Trip("nycc", load_vehicle().with_settings({"thermal.t_amb_degc": -11.5}))
    full, quick = (
        HostLibrary(tmp_path / name, values, precision) for name in ("full.so", "quick.so")
    )
    controllers = []
    for library in (full, quick):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(
                "qpmpc.codegen.controller.build_host_library", lambda *_, found=library: found
            )
            blocks = {"mh_qp.horizon.blocks": 7}
            settings = ControllerSettings().with_settings(blocks)
            controllers.append(GeneratedController(trip, settings, precision=precision))
    state = trip.plant.initial_state()
    for k in range(60):
        seen = trip.observation(k, state)
        one, other = (controller.decide(seen) for controller in controllers)
        assert repr(one) == repr(other)  # shortest text that is this number; NaN equals NaN
        state, _ = trip.plant.step(state, one.command, seen.demand_w, seen.speed_mps)
    for mine, its in zip(*(controller.plan() for controller in controllers), strict=True):
        assert mine.tobytes() == its.tobytes()


def test_only_the_numbers_of_another_vehicle_are_compiled(folder, calls) -> None:
    build_host_library(numbers())
    build_host_library(numbers(thermal__t_amb_degc=-12.0))
    build_host_library(numbers(trip__soc_init=0.55))
    first, *others = calls.sources
    assert "mpc_data.c" not in first
    assert "mpc_qp.c" in first
    assert others == [["mpc_data.c"]] * 3
    build_host_library(numbers(thermal__t_amb_degc=-12.0))
    assert len(calls.sources) == 4  # nothing for one that is there
    build_host_library(numbers("prius-liion"))  # has other numbers of pieces
    assert len(list(folder.glob("*.o"))) == 2


def test_an_object_that_was_altered_is_made_again(folder, calls) -> None:
    compiled(SMALL)
    file, library = only(folder, ".o"), only(folder, ".so")
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    library.unlink()
    assert compiled(SMALL) == library
    assert file.read_bytes() == whole
    assert calls.sources == [["one.c"], ["mpc_data.c"]] * 2


def test_a_compiler_that_makes_no_objects_compiles_in_full_and_says_so(
    folder, calls, caplog, monkeypatch
) -> None:
    monkeypatch.setattr(host_library, "_WITHOUT_OBJECTS", set())
    remarks.say_once.cache_clear()
    calls.makes_no_objects()
    compiled(SMALL)
    assert calls.sources == [["one.c"], ["mpc_data.c", "one.c"]]
    (record,) = caplog.records
    assert f"{calls.command} cannot link an object" in record.getMessage()
    compiled({**SMALL, "mpc_data.c": "int two = 3;\n"})
    assert calls.sources[2:] == [["mpc_data.c", "one.c"]]  # and is not asked again
    assert not list(folder.glob("*.o"))


def test_a_fault_in_the_sources_is_not_laid_at_the_compilers_door(folder, calls, caplog) -> None:
    with pytest.raises(CodegenError, match=r"one\.c"):
        compiled({**SMALL, "one.c": "no C\n"})
    assert not caplog.records
    compiled(SMALL)
    assert calls.sources[2:] == [["one.c"], ["mpc_data.c"]]


@pytest.mark.slow
@needs_maps
def test_libraries_are_closed_when_nobody_uses_them_any_more(folder, tmp_path) -> None:
    values = numbers()
    build_host_library(values)
    file = only(folder, ".so")
    gc.collect()
    gc.disable()  # at once, not when garbage is collected
    try:
        assert mapped(file) == 0
        trip = Trip("nycc")
        blocks = {"mh_qp.horizon.blocks": 7}
        controller = GeneratedController(trip, ControllerSettings().with_settings(blocks))
        controller.decide(trip.start)
        assert mapped(file) > 0
        second = build_host_library(values)  # the same file, loaded twice
        del controller
        assert mapped(file) > 0
        abi = second.step
        del second
        assert mapped(file) > 0  # a function keeps its library
        del abi
        assert mapped(file) == 0
        assert build_host_library(values).state_bytes > 0  # and once more
        for number in range(5):
            faulty = build_host_library(numbers(trip__t_cl_init_degc=50.0 + number), may_fail=True)
            assert faulty.solver_may_succeed is not None
        del faulty
        assert mapped(folder) == 0
    finally:
        gc.enable()


def test_of_processes_that_want_the_same_one_compiles(folder, calls) -> None:
    code = f"from qpmpc.codegen.host_library import compiled; print(compiled({SMALL!r}))"
    command = [sys.executable, "-c", code]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(4)]
    said = {process.communicate(timeout=60)[0].strip() for process in running}
    assert said == {str(only(folder, ".so"))}
    assert calls.sources == [["one.c"], ["mpc_data.c"]]
    assert not list(folder.glob(".*"))  # no lock is left


def test_a_builder_that_is_stuck_or_dead_holds_nobody_up(folder, monkeypatch) -> None:
    monkeypatch.setattr(library_cache, "LONGEST_WAIT_S", 0.1)
    folder.mkdir(parents=True, mode=0o700)
    lock = folder / f".{KEY}.lock"
    with lock.open("w") as stuck:
        flock(stuck, LOCK_EX)
        start = time.monotonic()
        assert kept_file(KEY, ".so", lambda: b"made").file.read_bytes() == b"made"
        assert time.monotonic() - start >= 0.1
        assert lock.exists()  # it is the other's
    other = KEY[1:] + "1"
    (folder / f".{other}.lock").touch()  # of a process that was killed
    monkeypatch.setattr(library_cache, "LONGEST_WAIT_S", 60.0)
    start = time.monotonic()
    kept_file(other, ".so", lambda: b"made")
    assert time.monotonic() - start < 30.0


def test_a_lock_that_its_owner_took_away_meanwhile_is_none(tmp_path) -> None:
    lock = tmp_path / "lock"
    held = library_cache._lock(lock)
    assert held is not None
    assert library_cache._lock(lock) is None
    waiting = os.open(lock, os.O_RDWR)  # opened while it was held
    lock.unlink()
    os.close(held)
    flock(waiting, LOCK_EX)  # which is no lock of that name any more
    new = library_cache._lock(lock)
    assert new is not None
    assert not os.path.samestat(os.fstat(new), os.fstat(waiting))
    os.close(waiting)
    os.close(new)
