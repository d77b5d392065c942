"""The wheel, installed away from the checkout, does what the checkout does."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parents[1]
MAPPED = ("codegen", "cycles", "verification")
FOLDERS = ("qpmpc", *MAPPED)
BUILD_FILES = ("pyproject.toml", "setup.py", "README.md", "LICENSE")


def run(*command: str | Path, cwd: Path) -> str:
    """Run outside of the checkout, without what would lead back to it."""
    env = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy to build from: setuptools would leave its `build` folder in the checkout."""
    copy = tmp_path_factory.mktemp("source")
    for name in BUILD_FILES:
        shutil.copy(ROOT / name, copy)
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("wheel")
    run(
        *(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-index"),
        *("--no-build-isolation", "--wheel-dir", target, source),
        cwd=source,
    )
    (built,) = target.iterdir()
    return built


@pytest.fixture(scope="module")
def scripts(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the commands of an environment with the wheel in it.

    Its dependencies are those of the running environment, appended to the path by a .pth file.
    That does not follow the .pth files there, so an editable qpmpc stays out of reach.
    """
    home = tmp_path_factory.mktemp("venv")
    venv.create(home, with_pip=False)
    bin_folder = home / "bin"
    python = bin_folder / "python"
    run(
        *(sys.executable, "-m", "pip", "--python", python, "install", "--quiet"),
        *("--no-deps", "--no-index", wheel),
        cwd=home,
    )
    site = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=home)
    dependencies = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    Path(site.strip(), "dependencies.pth").write_text("\n".join(sorted(dependencies)) + "\n")
    return bin_folder


def import_path(file: PurePosixPath) -> PurePosixPath:
    """Path in the wheel of a file in the checkout."""
    return "qpmpc" / file if file.parts[0] in MAPPED else file


def test_every_file_is_in_the_wheel(source: Path, wheel: Path) -> None:
    """A new kind of data file would be left out silently."""
    with zipfile.ZipFile(wheel) as archive:
        packed = {PurePosixPath(name) for name in archive.namelist()}
    expected = {
        import_path(PurePosixPath(file.relative_to(source).as_posix()))
        for folder in FOLDERS
        for file in (source / folder).rglob("*")
        if file.is_file() and file.suffix != ".md"
    }
    assert PurePosixPath("qpmpc/cycles/data/nycc.csv") in expected
    missing = sorted(str(path) for path in expected - packed)
    assert not missing, f"package-data in pyproject.toml lacks a pattern for {missing}"


def test_the_wheel_claims_one_name(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        top = {PurePosixPath(name).parts[0] for name in archive.namelist()}
    assert len(top) == 2
    assert "qpmpc" in top
    assert any(name.startswith("qpmpc_iptm-") and name.endswith(".dist-info") for name in top)


def test_installed_package_is_not_the_checkout(scripts: Path, tmp_path: Path) -> None:
    code = "import qpmpc, qpmpc.cycles as c; print(qpmpc.__file__); print(c.__file__)"
    for line in run(scripts / "python", "-c", code, cwd=tmp_path).splitlines():
        assert Path(line).is_relative_to(scripts.parent)


def test_installed_package_has_the_cycles(scripts: Path, tmp_path: Path) -> None:
    code = (
        "from qpmpc.cycles import cycle_names, load_cycle\n"
        "for name in cycle_names(): print(name, load_cycle(name).steps)"
    )
    output = run(scripts / "python", "-c", code, cwd=tmp_path)
    listed = dict(line.split() for line in output.splitlines())
    assert listed["nycc"] == "598"
    assert listed["nedc-truncated"] == "790"


def test_main_job_from_the_wheel(scripts: Path, tmp_path: Path) -> None:
    report, out = tmp_path / "runs.json", tmp_path / "out"
    command = ("compare", "nycc", "--controllers", "rule-based,mh-qp")
    table = run(scripts / "qpmpc", *command, "--json", report, "--out", out, cwd=tmp_path)
    assert "mh-qp" in table
    runs = {run["controller"]: run for run in json.loads(report.read_text())["runs"]}
    assert runs.keys() == {"rule-based", "mh-qp"}
    # the goal of the project on this cycle; the wheel must not lose any of it
    assert runs["mh-qp"]["saving_vs_rule_percent"] > 20
    assert all(excess == 0 for excess in runs["mh-qp"]["violations"].values())
    assert (out / "nycc.png").read_bytes().startswith(b"\x89PNG")
    assert {path.name for path in tmp_path.iterdir()} == {"runs.json", "out"}
