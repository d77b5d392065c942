"""``qpmpc doctor`` on machines with missing, hanging and broken pieces."""

import os
import sys
from pathlib import Path

import pytest

from qpmpc.cli.health import packages_found, tools_found
from qpmpc.cli.health.limited import MOST_BYTES, ask

COMPILER_OF_ARM = "arm-none-eabi-gcc"


@pytest.fixture
def path(tmp_path, monkeypatch) -> Path:
    """A PATH with nothing on it but what a test puts there."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    return folder


@pytest.fixture
def few_packages(monkeypatch) -> dict[str, list[str]]:
    """Requirements that are soon imported."""
    wanted = {"core": ["jinja2"], "plot": ["no-such-package"]}
    monkeypatch.setattr("qpmpc.cli.health.packages.requirements", lambda: wanted)
    return wanted


def tool(folder: Path, name: str, script: str) -> None:
    (folder / name).write_text(f"#!/bin/sh\n{script}\n")
    (folder / name).chmod(0o755)


def state_of(name: str) -> tuple[str, str]:
    (piece,) = [piece for piece in tools_found() if piece.name == name]
    return piece.state, piece.found


def test_this_machine_is_sound(cli, strict_json):
    """All packages of the lock are imported; a tool may be missing, and is then named."""
    done = cli("doctor", "--json", "-")
    assert done.code == 0
    found = strict_json(done.out)
    assert found["sound"] is True
    groups = {piece["group"] for piece in found["pieces"]}
    assert {"core", "plot", "verification", "sweep", "fastsim", "logs", "tools"} <= groups
    assert not groups & {"dev", "all"}
    for piece in found["pieces"]:
        assert piece["disables"]
        assert piece["remedy"]
        assert piece["state"] in ("ok", "missing", "broken")
        if piece["group"] == "core":
            assert piece["state"] == "ok"
    assert "numpy" in done.err  # the table


def test_missing_pieces_are_no_error_and_name_their_remedy(cli, path, few_packages):
    done = cli("doctor")
    assert (done.code, done.err) == (0, "")
    for words in (
        f"missing: {COMPILER_OF_ARM}. Disables: no firmware",
        "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi",
        "missing: no-such-package (plot). Disables: pictures",
        "pip install 'qpmpc-iptm[plot]'",
    ):
        assert words in done.out


@pytest.mark.parametrize("missing", ["no-such-package", "qpmpc_broken"])
def test_a_piece_of_the_core_that_is_missing_or_broken_is_exit_code_1(
    cli, path, few_packages, tmp_path, monkeypatch, missing
):
    installed(tmp_path, monkeypatch, "qpmpc_broken", "raise RuntimeError('a library\\nis gone')")
    few_packages["core"].append(missing)
    done = cli("doctor", "--json", tmp_path / "found.json")
    assert done.code == 1
    assert '"sound": false' in (tmp_path / "found.json").read_text()


def installed(folder: Path, monkeypatch, name: str, code: str) -> None:
    """Install a package of one module, as an import path has it."""
    (folder / f"{name}.py").write_text(code)
    info = folder / f"{name}-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
    monkeypatch.syspath_prepend(folder)
    paths = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(folder), paths])))


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("raise ImportError('libgone.so: not found')", "libgone.so"),
        ("import os; os._exit(3)", "ends Python: exit code 3"),
        ("import os; os.kill(os.getpid(), 11)", "signal 11"),
        ("raise SystemExit('@qpmpc_odd@@')", "SystemExit"),
    ],
)
def test_a_package_that_cannot_be_imported_is_broken(
    tmp_path, monkeypatch, few_packages, code, words
):
    installed(tmp_path, monkeypatch, "qpmpc_odd", f"print('hello')\n{code}")
    few_packages["core"] = ["qpmpc_odd", "jinja2"]
    found = {piece.name: piece for piece in packages_found()}
    assert found["qpmpc_odd"].state == "broken"
    assert words in found["qpmpc_odd"].found
    assert found["jinja2"].state == "ok"


def test_a_package_whose_import_hangs_is_broken(tmp_path, monkeypatch, few_packages):
    installed(tmp_path, monkeypatch, "qpmpc_odd", "import time; time.sleep(60)")
    monkeypatch.setattr("qpmpc.cli.health.packages.LIMIT_S", 0.5)
    few_packages["core"] = ["qpmpc_odd"]
    found = {piece.name: piece for piece in packages_found()}
    assert found["qpmpc_odd"].state == "broken"
    assert "no answer in 0.5 s" in found["qpmpc_odd"].found


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("/bin/sleep 60", "no answer in 0.3 s"),
        ("/bin/sleep 60 &\nexit 0", "no answer in 0.3 s"),  # a child keeps the pipe open
        ("exec >&- 2>&-; /bin/sleep 60", "in 0.3 s"),
    ],
)
def test_a_tool_that_hangs_is_broken(path, monkeypatch, script, words):
    monkeypatch.setattr("qpmpc.cli.health.tools.LIMIT_S", 0.3)
    tool(path, "valgrind", script)
    state, found = state_of("valgrind")
    assert state == "broken"
    assert words in found


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("while :; do echo x; done", "without end"),
        ("exit 3", "exit code 3"),
        ("kill -9 $$", "signal 9"),
    ],
)
def test_a_tool_that_fails_is_broken(path, script, words):
    tool(path, "valgrind", script)
    state, found = state_of("valgrind")
    assert state == "broken"
    assert words in found


def test_a_tool_that_is_no_program_is_broken(path):
    (path / "valgrind").write_bytes(b"\x7fELF no program")
    (path / "valgrind").chmod(0o755)
    assert state_of("valgrind")[0] == "broken"


def test_a_compiler_without_headers_is_broken(path):
    """Debian's cross compiler comes without a C library, which is a package of its own."""
    without = 'echo "x.c:1: fatal error: math.h"; exit 1'
    script = f'case "$1" in --version) echo 12.2.1;; *) {without};; esac'
    tool(path, COMPILER_OF_ARM, script)
    state, found = state_of(COMPILER_OF_ARM)
    assert state == "broken"
    assert "math.h" in found


def test_the_answer_of_a_tool_is_shown_escaped(cli, path, few_packages):
    tool(path, "valgrind", "printf 'valgrind-3.19.0\\033[31m\\n'")
    done = cli("doctor")
    assert done.code == 0
    assert "\x1b" not in done.out
    assert "valgrind 3.19.0" in done.out


def test_nothing_of_an_endless_answer_is_kept():
    done = ask([sys.executable, "-c", "while True: print('x' * 1000)"], 10.0)
    assert len(done.text) <= MOST_BYTES
    assert done.fault


def test_a_cache_that_others_may_write_to_is_said(cli, path, few_packages, tmp_path, monkeypatch):
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    (tmp_path / "compiled").mkdir()
    (tmp_path / "compiled").chmod(0o777)
    monkeypatch.chdir(tmp_path)
    Path("results").write_text("a file")
    done = cli("doctor")
    assert done.code == 0
    assert "broken: compiled controllers" in done.out
    assert "chmod 700" in done.out
    assert "broken: results" in done.out
