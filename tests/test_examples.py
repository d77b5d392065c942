"""Every example runs by itself, says something, and complains of nothing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from run_folder import shared_cache

FOLDER = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(file.name for file in FOLDER.glob("*.py"))
# run where their figures are tested
ELSEWHERE = ("engine_starts.py", "nox.py", "battery_temperature.py")

ARGUMENTS = {"prototype_cost.py": ["10"]}  # seconds driven by each way


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Folder of one cache for all of them, as on a user's machine: most have the same C library."""
    return shared_cache(tmp_path_factory)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SCRIPTS if name not in ELSEWHERE])
def test_example(name: str, tmp_path: Path, cache: str) -> None:
    if name in ("embedded.py", "prototype_cost.py") and not all(map(shutil.which, ("make", "cc"))):
        pytest.skip("not installed: make, cc")
    done = subprocess.run(
        [sys.executable, "-W", "error", FOLDER / name, *ARGUMENTS.get(name, ())],
        cwd=tmp_path,
        env={**os.environ, "QPMPC_CACHE_DIR": cache},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout
    assert done.stderr == ""


def test_all_are_listed() -> None:
    text = (FOLDER / "README.md").read_text("utf-8")
    assert all(f"({name})" in text for name in SCRIPTS)


def test_an_own_controller_takes_a_dozen_lines_and_one_import() -> None:
    lines = (FOLDER / "own_controller.py").read_text("utf-8").partition('"""\n')[2].splitlines()
    code = [line for line in lines if line.strip()]
    assert len(code) <= 12
    assert [line for line in code if "import" in line] == ["import qpmpc"]


def test_a_changed_cvxpy_problem_drives_in_fifteen_lines() -> None:
    lines = (FOLDER / "cvxpy_planner.py").read_text("utf-8").partition('"""\n')[2].splitlines()
    assert len([line for line in lines if line.strip()]) <= 15


def test_an_own_vehicle_says_what_differs_and_no_more() -> None:
    lines = (FOLDER / "my_van.toml").read_text("utf-8").splitlines()
    assert lines[0] == 'base = "prius-nimh"'
    assert len([line for line in lines if "=" in line]) <= 4
