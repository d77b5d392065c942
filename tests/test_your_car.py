"""docs/your_car.md, from the files of a bench and a logger to the report, step by step."""

import json
import re
import shlex
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from run_folder import shared_cache

import qpmpc
from qpmpc.cli import main

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "your_car.md").read_text("utf-8")
STEPS = re.findall(r"^```bash\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
HERE_FILE = re.compile(r"cat > (\S+) <<END\n(.*?)^END\n", re.MULTILINE | re.DOTALL)
SPEEDS_RPM = range(1000, 5300, 250)
NO_VALUE = 40  # row of the log, and point of the map, that has none


def full_nm(rpm: float) -> float:
    return 121.0 - 33.0 * ((rpm - 3250) / 2250) ** 2


def bench() -> str:
    """A three-cylinder engine at 18 speeds that are met to some 1/min, points up to full load."""
    random = np.random.default_rng(1)
    points = []
    for nominal_rpm in SPEEDS_RPM:
        full = full_nm(nominal_rpm)
        for torque_nm in [*np.arange(10.0, full - 4.0, 10.0), full]:
            rpm = nominal_rpm + random.uniform(-4.0, 4.0)
            friction_nm = 7.5 + 0.0035 * rpm + 0.7e-6 * rpm**2
            g_per_kwh = 3.6e6 / (0.42 * 43.0e3) * (1.0 + friction_nm / torque_nm)
            power_kw = torque_nm * rpm * np.pi / 30e3
            points.append([rpm, torque_nm, power_kw, g_per_kwh, 90.0])
    rows = [";".join(f"{value:.2f}" for value in point).replace(".", ",") for point in points]
    rows[NO_VALUE] = ";".join([*rows[NO_VALUE].split(";")[:3], "----", "90,0"])
    head = ["Prüfstand 4;engine L3;order 22-0815", "n_mot;Md;Pe;be;T_KW", "1/min;Nm;kW;g/kWh;°C"]
    return "\r\n".join([*head, *rows]) + "\r\n"


def drive() -> str:
    """Two trips of 100 s at 10 Hz with 20 min of parking between, on a slope of 2 %."""
    shape = np.interp(np.arange(0, 100, 0.1), [0, 5, 15, 45, 55, 62, 74, 84, 95],
                      [0, 0, 13, 13, 0, 0, 12, 12, 0])  # fmt: skip
    speed_mps = np.concatenate([shape, np.zeros(12000), shape])
    height_m = 500.0 + 0.02 * np.cumsum(speed_mps) * 0.1
    begin = datetime(2025, 5, 6, 7, 31, tzinfo=UTC)
    rows = ["time,speed_kmh,rpm,alt_gps_m"]
    for k, (speed, height) in enumerate(zip(speed_mps, height_m, strict=True)):
        stamp = (begin + timedelta(seconds=0.1 * k)).isoformat()
        kmh = "" if k == NO_VALUE else f"{3.6 * speed:.1f}"
        rows.append(f"{stamp},{kmh},{900 if speed else ''},{height:.1f}")
    return "\n".join(rows) + "\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where all of the page has been done."""
    path = tmp_path_factory.mktemp("car")
    (path / "bench.csv").write_bytes(bench().encode("cp1252"))
    (path / "log.csv").write_text(drive(), "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path)
        patch.setenv("QPMPC_CACHE_DIR", shared_cache(tmp_path_factory))
        for step in STEPS:
            for name, text in HERE_FILE.findall(step):
                Path(name).write_text(text, "utf-8")
            for command in HERE_FILE.sub("", step).splitlines():
                extra = ["--json", "map.json"] if "vehicle-from-map" in command else []
                with pytest.raises(SystemExit) as stop:
                    main([*shlex.split(command)[1:], *extra])
                assert stop.value.code == 0, command
        yield path


@pytest.mark.slow
def test_what_was_odd_about_the_bench_is_said(folder):
    remarks = json.loads((folder / "map.json").read_text())["remarks"]
    points = len(bench().splitlines()) - 3
    assert "the text is not UTF-8: read as Windows-1252" in remarks
    assert "1 line(s) above the header not read" in remarks
    assert f"1 of {points} points without a value left out" in remarks


def test_the_car_is_the_users(folder):
    car = qpmpc.load_vehicle(folder / "my_car.toml")
    assert (car.chassis.mass_kg, car.chassis.road_load_a_n) == (1420, 105)
    most_w = max(full_nm(rpm) * rpm * np.pi / 30 for rpm in SPEEDS_RPM)
    # the greatest power of the data, at a speed that is off by up to 4 of some 5000 1/min
    assert car.engine.power_max_w == pytest.approx(most_w, rel=1e-3)


def test_the_report_has_both_trips_and_the_optimum(folder):
    runs = json.loads((folder / "report" / "compare.json").read_text())["runs"]
    assert [run["cycle"] for run in runs] == 3 * ["commute-1"] + 3 * ["commute-2"]
    for run in runs:
        assert run["distance_km"] == pytest.approx(0.1 * drive_mps() / 1000, rel=0.01)
        assert run["t_cl_min_degc"] >= 15.0
    assert all(run["fuel_above_dp_percent"] == 0.0 for run in runs if run["controller"] == "dp")
    page = (folder / "report" / "compare.html").read_text("utf-8")
    assert "ambient 14 °C" in page
    assert "SOC 0.6 at the start." in page


def test_the_hill_is_in_the_cycle(folder):
    """Filtered, but not steeper or flatter over the whole."""
    cycle = qpmpc.load_cycle(folder / "commute-1.csv")
    climb = float(np.sum(cycle.step_grade * cycle.step_speed_mps) / np.sum(cycle.step_speed_mps))
    assert climb == pytest.approx(0.02, abs=0.001)


def drive_mps() -> float:
    """Sum of the speeds of one trip, 10 a second."""
    speeds = [float(row.split(",")[1] or 0.0) for row in drive().splitlines()[1:]]
    return sum(speeds) / 3.6 / 2
