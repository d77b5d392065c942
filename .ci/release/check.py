"""Build wheel and sdist, install them in clean environments, and drive a cycle there.

``make release-check`` runs it. For each Python that the package supports and this machine has: a
new environment, the wheel and the newest of what the core requires, from the index; then the
command line. The sdist is installed once more, by the first Python. Versions that are not here are
named; the exit code is 1 if anything fails, or if no version is here at all.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VERSIONS = ("3.11", "3.12", "3.13", "3.14")
LEAST_SAVING_PERCENT = 20.0  # of mh-qp against the rules on NYCC: the goal of the project
LIMIT_S = 900.0  # of one command: an installation on a slow line


def run(*command: str | Path, cwd: Path) -> str:
    """Run outside of the checkout, without what would lead back to it.

    Raises
    ------
    RuntimeError
        If it fails; with its last line.
    """
    env = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=env,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines() or ["no word"]
        raise RuntimeError(f"{Path(command[0]).name} {command[1]} ..: {said[-1]}")
    return done.stdout


def interpreters() -> dict[str, str]:
    """Return the path of each supported Python that runs here, by its version."""
    found: dict[str, str] = {}
    for version in VERSIONS:
        for candidate in _candidates(version):
            asked = [candidate, "-c", "import ensurepip, sys; print(sys.version_info[:2])"]
            # a shim of a version manager is there whether its version is or not
            done = subprocess.run(asked, capture_output=True, text=True, check=False)
            if done.stdout.strip() == str(tuple(map(int, version.split(".")))):
                found[version] = candidate
                break
    return found


def _candidates(version: str) -> Iterator[str]:
    for name in (f"python{version}", "python3"):
        if path := shutil.which(name):
            yield path
    for folder in sorted(Path("~/.pyenv/versions").expanduser().glob(f"{version}.*")):
        yield str(folder / "bin" / "python")


def built(source: Path, folder: Path) -> tuple[Path, Path]:
    """Build both from a copy: setuptools would leave its folders in the checkout.

    Raises
    ------
    RuntimeError
        If a build fails, or the sdist lacks a file that the wheel has.
    """
    copy = folder / "source"
    names = subprocess.run(
        ["git", "ls-files", "-z"], cwd=source, capture_output=True, text=True, check=True
    ).stdout.split("\0")
    for name in filter(None, names):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source / name, copy / name)
    run(sys.executable, "-m", "venv", folder / "builder", cwd=folder)
    builder = folder / "builder" / "bin" / "python"
    run(builder, "-m", "pip", "install", "--quiet", "build", cwd=folder)
    run(builder, "-m", "build", "--outdir", folder / "dist", cwd=copy)
    (wheel,) = (folder / "dist").glob("*.whl")
    (sdist,) = (folder / "dist").glob("*.tar.gz")
    missing = of_wheel(wheel) - of_sdist(sdist)
    if missing:
        raise RuntimeError(f"the sdist lacks {', '.join(sorted(missing)[:5])}")
    return wheel, sdist


def of_wheel(wheel: Path) -> set[str]:
    """Return the package's files, as they are called in the checkout."""
    with zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if ".dist-info/" not in name]
    mapped = re.compile(r"^qpmpc/((?:codegen|cycles|verification)/)")
    return {mapped.sub(r"\1", name) for name in names}


def of_sdist(sdist: Path) -> set[str]:
    """Return its files, without its top folder."""
    with tarfile.open(sdist) as archive:
        return {name.partition("/")[2] for name in archive.getnames()}


def try_out(python: str, package: Path, folder: Path) -> str:
    """Install into a new environment and drive; return the saving in a line.

    Raises
    ------
    RuntimeError
        If a command fails or a figure is not what it should be.
    """
    home, work = folder / "venv", folder / "work"
    work.mkdir(parents=True)
    run(python, "-m", "venv", home, cwd=folder)
    own = home / "bin" / "python"
    pip = (own, "-m", "pip", "--disable-pip-version-check")
    run(*pip, "install", "--quiet", package, cwd=work)
    run(*pip, "check", cwd=work)
    qpmpc = home / "bin" / "qpmpc"
    run(qpmpc, "--version", cwd=work)
    run(qpmpc, "doctor", "--json", "doctor.json", cwd=work)
    found = json.loads((work / "doctor.json").read_text("utf-8"))
    if not Path(run(own, "-c", "import qpmpc; print(qpmpc.__file__)", cwd=work)).is_relative_to(
        home
    ):
        raise RuntimeError("what is imported is not what was installed")
    drive = ("compare", "nycc", "--controllers", "rule-based,mh-qp", "--json", "runs.json")
    run(qpmpc, *drive, cwd=work)
    runs = json.loads((work / "runs.json").read_text("utf-8"))["runs"]
    (mh_qp,) = (each for each in runs if each["controller"] == "mh-qp")
    saving = mh_qp["saving_vs_rule_percent"]
    if saving < LEAST_SAVING_PERCENT or any(mh_qp["violations"].values()):
        raise RuntimeError(f"mh-qp saves {saving:.1f} %, violations {mh_qp['violations']}")
    numpy = next(piece["found"] for piece in found["pieces"] if piece["name"] == "numpy")
    return f"mh-qp saves {saving:.1f} % on nycc, numpy {numpy}"


def main() -> int:
    """Check all; return the exit code."""
    found = interpreters()
    failed = not found
    with tempfile.TemporaryDirectory(prefix="qpmpc-release-") as scratch:
        folder = Path(scratch)
        wheel, sdist = built(ROOT, folder)
        print(f"built {wheel.name} and {sdist.name}", flush=True)
        jobs = [(version, path, wheel) for version, path in found.items()]
        jobs += [(version, path, sdist) for version, path in [*found.items()][:1]]
        for number, (version, path, package) in enumerate(jobs):
            kind = "wheel" if package is wheel else "sdist"
            place = folder / str(number)
            place.mkdir()
            try:
                print(f"Python {version}, {kind}: {try_out(path, package, place)}", flush=True)
            except (RuntimeError, subprocess.TimeoutExpired) as error:
                failed = True
                print(f"Python {version}, {kind}: FAILED: {error}", flush=True)
            shutil.rmtree(place, ignore_errors=True)
    absent = [version for version in VERSIONS if version not in found]
    if absent:
        print(f"not on this machine, so not tried: Python {', '.join(absent)}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
