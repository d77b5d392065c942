"""Many optima: grids by name, threads, memory, what is no optimum, the error of the quick grid."""

import json
from collections.abc import Callable
from math import ceil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpmpc import simulate
from qpmpc.controllers.settings import as_settings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.dynamic_programming import DpSettings, cache, quick_error, solve_dp, sweep
from qpmpc.verification.dynamic_programming.threads import default_threads

VEHICLE = load_vehicle("paper-nimh")  # its engine gives all it has at once, even uphill
TYPED = {"soc_step": 0.004, "t_cl_step_k": 1.0, "power_step_w": 1000.0, "refinement": 4}


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path / "cache"))


def dp_of(settings: dict[str, object]) -> DpSettings:
    named = {f"dp.{key}": value for key, value in settings.items()}
    return as_settings(named).of("dp", DpSettings())


def climb(grade: float) -> Cycle:
    return Cycle.from_samples("climb", np.arange(6), np.full(6, 40.0), np.full(6, grade))


def urban() -> Cycle:
    whole = load_cycle("udds")
    return Cycle.from_samples("urban", whole.time_s[:121], whole.speed_mps[:121])


# settings


def test_the_quick_grid_has_a_name() -> None:
    named, typed = dp_of({"grid": "quick"}), dp_of(dict(TYPED))
    assert named == DpSettings.quick()
    assert named.cells == typed.cells
    assert cache.key(urban(), VEHICLE, named) == cache.key(urban(), VEHICLE, typed)
    assert dp_of({}).cells == (0.002, 0.5, 500.0, 8)
    assert dp_of({"grid": "quick"}).doubled().cells == (0.004, 1.0, 500.0, 8)


@pytest.mark.parametrize("key", TYPED)
def test_a_step_beside_the_quick_grid_is_refused(key: str) -> None:
    with pytest.raises(InputError, match=f"^dp: grid 'quick' has its own {key}: give one"):
        dp_of({"grid": "quick", key: TYPED[key]})


def test_an_unknown_grid_is_refused() -> None:
    with pytest.raises(InputError, match=r"^dp: grid: must be 'reference' or 'quick'"):
        dp_of({"grid": "fast"})


def test_threads_of_a_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QPMPC_THREADS", "3")
    assert default_threads() == 3
    monkeypatch.delenv("QPMPC_THREADS")
    assert default_threads() >= 1


@pytest.mark.parametrize("text", ["0", "-1", "1.5", "two", "1025", "9" * 5000, "\x1b[2J", "²"])
def test_other_numbers_of_threads_are_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QPMPC_THREADS", text)
    with pytest.raises(InputError, match=r"^QPMPC_THREADS: must be an integer") as error:
        solve_dp(climb(0.0), VEHICLE)
    assert str(error.value).isprintable()
    # who says how many is not asked
    assert solve_dp(climb(0.0), VEHICLE, DpSettings(grid="quick", threads=1)).admissible


# memory


def test_memory_does_not_change_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = DpSettings(grid="quick", threads=1)

    def solved(memory: float) -> list[np.ndarray]:
        monkeypatch.setattr(sweep, "VALUES_BYTES", memory)
        solution = solve_dp(urban(), VEHICLE, settings, use_cache=False)
        return [
            solution.fuel_g,
            solution.soc,
            solution.soc_costate_g,
            solution.t_cl_costate_g_per_k,
        ]

    all_kept, some, least = (solved(memory) for memory in (1e9, 2e6, 0.0))
    for a, b, c in zip(all_kept, some, least, strict=True):
        np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(a, c)


@given(st.integers(1, 10**5), st.integers(1, 10**9))
def test_segments_fit_into_the_memory_or_are_the_least(steps: int, value_bytes: int) -> None:
    def kept(length: int) -> int:
        return (ceil(steps / length) + length) * value_bytes

    length = sweep.segment_length(steps, value_bytes)
    assert 1 <= length <= ceil(steps**0.5)
    assert kept(length) <= sweep.VALUES_BYTES or length == ceil(steps**0.5)
    assert length == 1 or kept(length - 1) > sweep.VALUES_BYTES


# what is no optimum


def test_a_run_that_is_no_optimum_is_not_comparable() -> None:
    """72 kW, 1 kW more than the engine has: no limit is left, but SOC falls by 0.1 %."""
    run = simulate(climb(0.06), "dp", VEHICLE, settings={"dp.grid": "quick"})
    assert not run.excess.any.any()
    assert abs(run.soc_correction_g) < 0.03 * run.fuel_g
    (reason,) = run.not_comparable
    assert "found nothing that keeps all limits and the final SOC" in reason
    said = [line for line in run.summary()["remarks"] if "dynamic programming" in line]
    assert said == [f"dp on climb: not comparable: {reason}"]
    assert simulate(climb(0.05), "dp", VEHICLE, settings={"dp.grid": "quick"}).comparable


def test_a_tube_that_does_not_settle_is_remarked() -> None:
    narrow = {"dp.grid": "quick", "dp.tube_soc": 1e-3, "dp.tube_t_cl_k": 0.1}
    run = simulate("nedc-truncated", "dp", VEHICLE, settings=narrow)
    assert [line for line in run.remarks if "the edge of its tube after 6 tubes" in line]
    assert not simulate(urban(), "dp", VEHICLE, settings={"dp.grid": "quick"}).remarks


# the error of the quick grid


@pytest.fixture
def trips(tmp_path: Path) -> Callable[[str, float], str]:
    def write(name: str, speed_mps: float) -> str:
        rows = [f"{k},{min(speed_mps, 3 * (33 - k))},0.2" for k in range(34)]
        (tmp_path / name).write_text("\n".join(["time_s,speed_mps,grade", *rows]) + "\n")
        return str(tmp_path / name)

    return write


def test_quick_error(
    trips: Callable[[str, float], str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "error.json"
    cycles = [trips("hill.csv", 12), trips("we|ird.csv", 30)]
    assert quick_error.main([*cycles, "--vehicle", "paper-nimh", "--json", str(file)]) == 0
    hill, steep = json.loads(file.read_text())["rows"]
    # seconds are few cells long: the error is larger than on a trip, and of either sign
    assert abs(hill["difference_percent"]) < 5.0
    assert hill["quick"]["fuel_g"] > 0.0
    # no car of 81 kW climbs 20 % at 30 m/s
    assert not steep["quick"]["admissible"]
    assert steep["difference_percent"] is None
    lines = capsys.readouterr().out.splitlines()
    assert lines[3].startswith(r"| we\|ird | 33 | paper-nimh |")
    assert "not admissible" in lines[3]
    assert lines[-1].startswith("1 of 2 compared")


def test_quick_error_of_nothing_known(capsys: pytest.CaptureFixture[str]) -> None:
    assert quick_error.main(["nowhere"]) == 2
    assert capsys.readouterr().err.startswith("qpmpc: unknown cycle 'nowhere'")
