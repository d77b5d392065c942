"""Names: what is shipped, what an installed package adds, what is said of a wrong one."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from qpmpc import Controller, ControllerSettings, InputError, Planner, Trip, simulate
from qpmpc.names import Names
from qpmpc.registry import (
    CONTROLLERS,
    PLANNERS,
    TABLES,
    check_controllers,
    controller_names,
    make_controller,
    split_settings,
)

SAMPLE = Path(__file__).parent / "sample_package"


def test_default_first() -> None:
    assert controller_names()[0] == "mh-qp"


def test_tables_are_of_one_kind_each() -> None:
    assert [table.kind for table in TABLES] == [
        "controller",
        "planner",
        "solver",
        "vehicle",
        "cycle",
        "check",
        "plant",
    ]


@pytest.mark.parametrize("name", controller_names())
def test_names_are_those_of_the_runs(name: str) -> None:
    trip = Trip("nycc")
    controller = make_controller(name, trip)
    assert isinstance(controller, Controller)
    assert controller.name == name
    assert controller.trip is trip


def test_no_name_stands_twice() -> None:
    assert not set(CONTROLLERS.shipped) & set(PLANNERS.shipped)


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.kind)
def test_a_wrong_name_has_the_nearest_and_all(table) -> None:
    name = table.names()[-1]
    with pytest.raises(InputError) as refusal:
        table.check(f"{name}x")
    line = str(refusal.value)
    assert f"unknown {table.kind} '{name}x', did you mean '{name}'?" in line
    assert all(known in line for known in table.names())
    assert "\n" not in line


def test_what_is_no_controller_is_refused() -> None:
    with pytest.raises(InputError, match=r"neither a qpmpc\.Controller nor"):
        make_controller(object(), Trip("nycc"))  # type: ignore[arg-type]


def test_twice_and_unknown() -> None:
    with pytest.raises(InputError, match="'mh-qp' is named twice"):
        check_controllers(["mh-qp", "dp", "mh-qp"])
    with pytest.raises(InputError, match="unknown controller 'mh-pq', did you mean 'mh-qp'"):
        check_controllers(["mh-pq"])


def test_settings_are_split() -> None:
    of_vehicle, settings = split_settings(
        {"thermal.t_amb_degc": -15, "mh_qp.admm.iterations": 25, "dp.refinement": 2}
    )
    assert of_vehicle == {"thermal.t_amb_degc": -15}
    assert settings.mh_qp.admm.iterations == 25
    assert settings.others == {"dp": {"refinement": 2}}


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("nonsense.x", 1, "names start with one of"),
        ("mh_qp.nonsense", 1, "nonsense"),
        ("dp.nonsense", 1, "nonsense"),
        ("dp.refinement", 0.5, "refinement"),
        ("mh_nlp.x", 1, "no settings of its own"),
        ("name", "x", "names start with a section"),
        ("others.x", 1, "names start with one of"),
        ("thermal", -7, "'thermal' is a section"),
        ("t_amb", -7, "did you mean 'thermal.t_amb_degc'"),
        ("heat.t_amb_degc", -7, "did you mean 'thermal.t_amb_degc'"),
        ("iterations", 25, "did you mean 'mh_qp.admm.iterations'"),
        ("mhqp.admm.iterations", 1, "names start with one of"),
    ],
)
def test_wrong_settings_are_one_line(key: str, value: object, said: str) -> None:
    with pytest.raises(InputError, match=said) as refusal:
        split_settings({key: value})
    assert "\n" not in str(refusal.value)


def test_made_settings_of_nobody_are_refused_too() -> None:
    settings = ControllerSettings().with_settings({"mhqp.admm.iterations": 25})
    with pytest.raises(InputError, match=r"'mhqp\.admm\.iterations'"):
        simulate("nycc", settings=settings)


class Own(Planner):
    name = "own"

    def plan(self, seen):
        raise NotImplementedError


def test_an_own_class_without_settings_says_so() -> None:
    with pytest.raises(InputError, match="'own' has no settings of its own"):
        split_settings({"own.x": 1}, [Own])


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment in which the sample package is installed."""
    folder = tmp_path_factory.mktemp("sample")
    source = shutil.copytree(SAMPLE, folder / "source")
    site = folder / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--target", site, source], check=True, capture_output=True)
    path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, "PYTHONPATH": path}


def run(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "qpmpc", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_package_adds_controllers_vehicles_and_cycles(installed: dict[str, str]) -> None:
    names = "sample-threshold,sample-steady,rule-based,mh-qp"
    done = run(
        installed, "compare", "sample-hill", "--vehicle", "sample-car", "--controllers", names,
        "--set", "sample_threshold.on_w=5000", "--json", "-",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    runs = json.loads(done.stdout)["runs"]
    assert [row["controller"] for row in runs] == names.split(",")
    assert {row["vehicle"] for row in runs} == {"sample-car"}
    assert {row["cycle"] for row in runs} == {"sample-hill"}
    for command, name in (("cycles", "sample-hill"), ("vehicles", "sample-car")):
        assert name in run(installed, command).stdout
    threshold, steady = runs[:2]
    assert 0.0 < threshold["engine_on_share"] < 1.0
    assert steady["fallback_steps"] == 0


def test_its_settings_count(installed: dict[str, str]) -> None:
    shares = []
    for on_w in ("2000", "30000"):
        done = run(
            installed, "simulate", "sample-hill", "--controller", "sample-threshold",
            "--set", f"sample_threshold.on_w={on_w}", "--json", "-",
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        shares.append(json.loads(done.stdout)["engine_on_share"])
    assert shares[0] > shares[1]


def test_a_package_adds_a_solver(installed: dict[str, str]) -> None:
    results = []
    for solver in ("osqp", "sample-solver"):
        done = run(
            installed, "simulate", "sample-hill",
            "--set", "mh_qp.implementation=python", "--set", f"mh_qp.solver={solver}",
            *(("--set", "mh_qp.admm.iterations=50") if solver == "osqp" else ()),  # as the sample
            "--json", "-",
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        data = json.loads(done.stdout)
        assert data["solver"]["name"] == solver
        results.append(data["fuel_g"])
    assert results[0] == results[1]  # it is OSQP under another name


def test_a_package_adds_a_check(installed: dict[str, str]) -> None:
    done = run(installed, "verify", "--only", "sample-check", "--json", "-")
    assert done.returncode == 0, done.stderr
    assert "Two and two" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--controller", "sample-broken"], "of sample-qpmpc cannot be loaded"),
        (["--controller", "sample-thresold"], "did you mean 'sample-threshold'?"),
        (["--set", "sample_threshold.nonsense=1"], "nonsense"),
        (["--set", "sample-threshold.on_w=1"], "did you mean 'sample_threshold'?"),
    ],
)
def test_what_goes_wrong_in_a_package_is_one_line(
    installed: dict[str, str], arguments: list[str], said: str
) -> None:
    done = run(installed, "simulate", "sample-hill", *arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_shipped_name_stays_and_two_of_one_name_are_said(tmp_path, monkeypatch, caplog) -> None:
    """Also where the shipped name is of the other kind, controller or planner."""
    points = {
        "zebra": "[qpmpc.controllers]\nbaseline-mpc = zebra:A\ntwice = zebra:B\n",
        "antelope": "[qpmpc.controllers]\nmh-qp = antelope:A\ntwice = antelope:B\n",
    }
    for package, text in points.items():
        folder = tmp_path / f"{package}-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Name: {package}\nVersion: 1.0\n")
        (folder / "entry_points.txt").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    names = Names("controller", CONTROLLERS.shipped, beside=PLANNERS.shipped)
    assert {name: point.value for name, point in names.added.items()} == {"twice": "antelope:B"}
    assert sorted(caplog.messages) == [
        "controller 'baseline-mpc' of zebra:A is not used: a shipped name",
        "controller 'mh-qp' of antelope:A is not used: a shipped name",
        "controller 'twice' of zebra:B is not used: antelope:B is",
    ]
