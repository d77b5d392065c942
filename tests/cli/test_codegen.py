"""``qpmpc codegen``: what it writes, and what it refuses."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.settings import MhQpSettings

EXTRAS = (
    *("matplotlib", "plotly", "pandas", "casadi", "numba", "piqp", "clarabel", "daqp", "qoco"),
    *("highspy", "proxsuite", "scs", "dask", "distributed", "pyarrow", "hypothesis", "pytest"),
)


def test_default_is_a_host_project_that_builds(cli, tmp_path):
    folder = tmp_path / "new" / "controller"
    done = cli("codegen", folder)
    assert (done.code, done.err) == (0, "")
    names = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    settings = MhQpSettings()
    stages = settings.horizon.short_stages + settings.horizon.blocks * settings.horizon.classes
    assert done.out == (
        f"{folder}: {len(names)} files written, target host, f32, admm, {stages} stages, "
        f"{settings.admm.iterations} iterations per step; start with README.md\n"
    )
    assert {"README.md", "NOTICE", "Makefile", "mpc.h", "mpc_admm.c", "mpc_data.c"} <= set(names)
    readme = (folder / "README.md").read_text()
    for name in names:
        if name.endswith(".c"):
            assert f"`{name}`" in readme, f"README.md does not say what {name} is"
    if compiler() is None:
        pytest.skip("no C compiler on this machine: what was written is not compiled")
    command = [compiler(), "-std=c99", "-fsyntax-only", *(n for n in names if n.endswith(".c"))]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr


@pytest.mark.parametrize("target", ["host", "cortex-m7"])
@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("algorithm", ["admm", "osqp"])
def test_every_combination_is_written_and_named(cli, tmp_path, target, precision, algorithm):
    options = ("--target", target, "--precision", precision, "--algorithm", algorithm)
    done = cli("codegen", tmp_path, *options, "--iterations", "33")
    assert (done.code, done.err) == (0, "")
    assert f"target {target}, {precision}, {algorithm}" in done.out
    config = (tmp_path / "mpc_config.h").read_text()
    assert "#define MPC_ITERATIONS 33 " in config
    assert f"#define MPC_F32 {int(precision == 'f32')}" in config
    assert f"#define MPC_SOLVER_OSQP {int(algorithm == 'osqp')}" in config
    assert (tmp_path / "mpc_osqp.c").exists() == (algorithm == "osqp")
    assert (tmp_path / "osqp" / "LICENSE").exists() == (algorithm == "osqp")
    assert (tmp_path / "cortex_m7.ld").exists() == (target == "cortex-m7")
    readme = (tmp_path / "README.md").read_text()
    assert f"target `{target}`" in readme
    assert f"algorithm `{algorithm}`" in readme


def test_vehicle_and_settings_reach_the_code(cli, tmp_path):
    done = cli(
        *("codegen", tmp_path, "--vehicle", "prius-liion", "--precision", "f64"),
        *("--set", "mh_qp.horizon.blocks=4", "--set", "thermal.t_amb_degc=3"),
    )
    assert done.code == 0
    config, data = ((tmp_path / n).read_text() for n in ("mpc_config.h", "mpc_data.c"))
    assert re.search(r"#define MPC_BLOCKS 4\b", config)
    assert "Vehicle: prius-liion" in data
    assert ".t_amb_degc = 3.0," in data


def test_writing_again_replaces_its_files_and_leaves_others_alone(cli, tmp_path):
    (tmp_path / "mine.txt").write_text("keep")
    assert cli("codegen", tmp_path).code == 0
    first = (tmp_path / "mpc_data.c").read_bytes()
    (tmp_path / "mpc_data.c").write_text("broken")
    assert cli("codegen", tmp_path).code == 0
    assert (tmp_path / "mpc_data.c").read_bytes() == first
    assert (tmp_path / "mine.txt").read_text() == "keep"


@pytest.mark.parametrize(
    ("args", "words"),
    [
        ([], ["DIR", "qpmpc codegen --help"]),
        (["out", "more"], ["more"]),
        (["out", "--nonsense"], ["--nonsense"]),
        (["out", "--target", "z80"], ["z80", "host", "cortex-m7"]),
        (["out", "--precision", "f16"], ["f16", "f32", "f64"]),
        (["out", "--algorithm", "qpoases"], ["qpoases", "admm", "osqp"]),
        (["out", "--iterations", "0"], ["iterations"]),
        (["out", "--iterations", "many"], ["--iterations", "integer"]),
        (["out", "--vehicle", "beetle"], ["beetle", "prius-nimh"]),
        (["out", "--set", "x"], ["KEY=VALUE"]),
        (["out", "--set", "mh_qp.admm.iteration=9"], ["iteration", "iterations"]),
        (["out", "--set", "mh_qp.horizon.blocks=0"], ["mh_qp.horizon.blocks"]),
        (["out", "--set", "mh_qp.qp.terminal_high=1"], ["terminal_high"]),
        (
            ["out", "--algorithm", "osqp", "--set", "mh_qp.admm.proximal_weight=1.2345678e-18"],
            ["proximal_weight"],
        ),
        (["out", "--prefix", "2nd_"], ["2nd_", "letter"]),
        (["out", "--prefix", "my-car_"], ["my-car_", "letter"]),
        (["file"], ["file"]),
        (["file/deeper"], ["file"]),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(cli, tmp_path, monkeypatch, args, words):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("not a folder")
    cli("codegen", *args).assert_refused(*words)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
    assert Path("file").read_text() == "not a folder"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_permission(cli, tmp_path):
    (tmp_path / "locked").mkdir(mode=0o500)
    done = cli("codegen", tmp_path / "locked" / "out")
    assert done.code == 2
    assert "permission" in done.err


@pytest.mark.parametrize("algorithm", ["admm", "osqp"])
def test_the_dependencies_of_the_core_suffice(tmp_path, algorithm):
    script = (
        "import sys\n"
        f"missing = {EXTRAS!r}\n"
        "class Missing:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in missing:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Missing())\n"
        "from qpmpc.cli import main\n"
        f"main(['codegen', {str(tmp_path)!r}, '--algorithm', {algorithm!r}])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "README.md").exists()
