"""The name qpmpc belongs to an unrelated distribution on PyPI too: never run beside it."""

import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

import qpmpc
from qpmpc._clash import refuse_other_qpmpc


def fake_distribution(site: Path, name: str) -> None:
    info = site / f"{name.replace('-', '_')}-3.1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 3.1.0\n")


def test_version_is_that_of_the_distribution() -> None:
    assert version("qpmpc-iptm") == qpmpc.__version__


def test_other_distribution_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_distribution(tmp_path, "qpmpc")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ImportError, match=r"qpmpc 3\.1\.0 .*pip uninstall qpmpc ") as caught:
        refuse_other_qpmpc()
    assert "\n" not in str(caught.value)


def test_similar_names_are_not_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_distribution(tmp_path, "qpmpc-iptm")
    fake_distribution(tmp_path, "qpmpcx")
    monkeypatch.syspath_prepend(tmp_path)
    refuse_other_qpmpc()


def test_import_beside_the_other_distribution_fails(tmp_path: Path) -> None:
    fake_distribution(tmp_path, "qpmpc")
    run = subprocess.run(
        [sys.executable, "-c", "import qpmpc.errors"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 1
    assert "pip uninstall qpmpc" in run.stderr.strip().splitlines()[-1]


@pytest.mark.slow
def test_controllers_are_made_without_casadi() -> None:
    """Only the nonlinear program takes it, and is refused before any of it is loaded."""
    code = (
        "import sys; sys.modules['casadi'] = None\n"
        "from qpmpc.registry import controller_names\n"
        "from qpmpc.cycles import load_cycle\n"
        "from qpmpc.errors import QpmpcError\n"
        "from qpmpc.simulation import simulate\n"
        "from qpmpc.vehicle import load_vehicle\n"
        "made = []\n"
        "for name in controller_names():\n"
        "    coarse = {'dp.soc_step': 0.01, 'dp.power_step_w': 2000.0} if name == 'dp' else {}\n"
        "    try: simulate(load_cycle('nycc'), name, load_vehicle(), settings=coarse)\n"
        "    except QpmpcError as error: assert 'casadi' in str(error).lower()\n"
        "    else: made.append(name)\n"
        "print(set(controller_names()) - set(made))\n"
        "print([name for name in sys.modules if 'mh_nlp' in name])\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines() == ["{'mh-nlp'}", "[]"]


def test_import_is_light() -> None:
    """`import qpmpc` alone loads no numerical library; the command line relies on it."""
    code = (
        "import sys, qpmpc; "
        "print(*{'numpy', 'scipy', 'osqp', 'cvxpy', 'pydantic', 'casadi'} & set(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
