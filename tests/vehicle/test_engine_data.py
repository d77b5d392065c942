"""Engines from maps and curves: read as people have them, and the same engine everywhere."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.errors import InputError
from qpmpc.pwa.fit import non_convexity
from qpmpc.pwa.model import PwaModel
from qpmpc.simulation import simulate
from qpmpc.vehicle import load_vehicle
from qpmpc.vehicle.engine import fuel_power_w, optimal_line
from qpmpc.vehicle.engine_map import EngineData, read_engine_data
from qpmpc.vehicle.from_map import vehicle_from_map
from qpmpc.vehicle.operating_line import operating_line, torque_range
from qpmpc.verification.independent.equations import Equations

CAR = load_vehicle("prius-nimh")
ENGINE = CAR.engine
LHV = ENGINE.lhv_j_per_g


def bench(step_rpm: float = 300.0, step_nm: float = 10.0) -> list[tuple[float, float, float]]:
    """Points of the shipped engine: rpm, Nm, g/s; each speed ends at its own torque limit."""
    rows = []
    for n in np.arange(1000.0, 5200.1, step_rpm).tolist():
        most = float(np.interp(n, ENGINE.torque_speed_rpm, ENGINE.torque_max_nm))
        for torque in [*np.arange(step_nm, most, step_nm).tolist(), most]:
            power = torque * n * np.pi / 30.0
            rows.append(
                (n, torque, float(fuel_power_w(ENGINE, n, power)) / ENGINE.lhv_j_per_kg * 1e3)
            )
    return rows


def power_w(n: float, torque: float) -> float:
    return torque * n * np.pi / 30.0


HEADERS = {
    "bsfc in brackets": (
        "Speed [rpm],Torque [Nm],BSFC [g/kWh]",
        lambda n, t, f: f"{n},{t!r},{f / power_w(n, t) * 3.6e6!r}",
    ),
    "efficiency, rad/s": (
        "speed_rad_per_s,torque_nm,efficiency",
        lambda n, t, f: f"{n * np.pi / 30!r},{t!r},{power_w(n, t) / (f * LHV)!r}",
    ),
    "per cent, comments": (
        "# measured\n\nspeed_rpm,torque_nm,efficiency_%",
        lambda n, t, f: f"{n},{t!r},{100 * power_w(n, t) / (f * LHV)!r}",
    ),
    "semicolons, units in a row, kg/h": (
        "Speed;Torque;Fuel\nrpm;Nm;kg/h",
        lambda n, t, f: f"{n};{t!r};{3.6 * f!r}".replace(".", ","),
    ),
    "tabs, g/s, a column more": (
        "note\ttorque_nm\tspeed_rpm\tfuel_g_per_s",
        lambda n, t, f: f"1\t{t!r}\t{n}\t{f!r}",
    ),
}


@pytest.fixture(params=HEADERS, scope="module")
def engine_file(request, tmp_path_factory):
    header, row = HEADERS[request.param]
    file = tmp_path_factory.mktemp("map") / "engine.csv"
    file.write_text("\n".join([header, *(row(*point) for point in bench())]))
    return file


def test_the_line_of_a_map_is_that_of_the_engine_it_was_measured_on(engine_file):
    """Triangles of 300 rpm and 10 Nm: fuel within 0.3 %, in the mean within 0.1."""
    line = operating_line(engine_file, read_engine_data(engine_file, LHV))
    assert np.abs(off(line)).max() < 3e-3
    assert abs(off(line).mean()) < 1e-3
    limit = np.interp(line.speed_rpm, ENGINE.torque_speed_rpm, ENGINE.torque_max_nm)
    assert np.all(line.power_w <= limit * line.speed_rpm * np.pi / 30.0 * (1.0 + 1e-3))
    assert line.power_w[-1] == pytest.approx(ENGINE.power_max_w, rel=1e-3)


@settings(max_examples=30, deadline=None)
@given(
    idle=st.floats(0.02, 0.5), slope=st.floats(5e-5, 1e-4), curved=st.floats(0.0, 1e-9),
    size=st.floats(5e3, 200e3),
)  # fmt: skip
def test_a_curve_is_its_line(idle, slope, curved, size, tmp_path_factory):
    file = tmp_path_factory.mktemp("curve") / "curve.csv"
    power = np.linspace(0.0, size, 30)
    fuel = idle + slope * power + curved * power**2
    file.write_text(
        "power_w,fuel_g_per_s\n"
        + "".join(f"{p!r},{f!r}\n" for p, f in zip(power.tolist(), fuel.tolist(), strict=True))
    )
    made = vehicle_from_map(file, "prius-nimh", "mine")
    line = optimal_line(made.vehicle.engine)
    np.testing.assert_allclose(
        line.fuel(power), fuel, rtol=3e-4, atol=1e-4
    )  # drawn anew every 50 W
    np.testing.assert_allclose(
        Equations(made.vehicle).fuel_g_per_s(power), fuel, rtol=3e-4, atol=1e-4
    )
    assert non_convexity(line.power_w, line.fuel_g_per_s)[0] == pytest.approx(0.0, abs=1e-3)


def test_the_file_loads_as_the_vehicle_and_drives(tmp_path):
    file = tmp_path / "engine.csv"
    file.write_text("power_kw,efficiency\n2,0.2\n5,0.29\n10,0.35\n25,0.38\n50,0.37\n60,0.35\n")
    made = vehicle_from_map(file, "prius-liion", "mine")
    (tmp_path / "mine.toml").write_text(made.toml)
    loaded = load_vehicle(tmp_path / "mine.toml")
    assert loaded == made.vehicle
    assert loaded.engine.power_max_w == 60e3
    seconds_to_full = load_vehicle("prius-liion").engine.power_max_w / 11833.0
    assert loaded.engine.power_max_w / loaded.engine.ramp_w_per_s == pytest.approx(
        seconds_to_full, rel=1e-4
    )
    assert loaded.chassis == CAR.chassis
    (python, c) = (
        simulate("nycc", "mh-qp", loaded, settings={"mh_qp.implementation": how})
        for how in ("python", "c")
    )
    assert python.summary()["fuel_g"] == pytest.approx(c.summary()["fuel_g"], rel=1e-4)
    assert max(c.summary()["violations"].values()) == 0.0


def test_a_line_that_is_not_convex_says_what_its_model_loses(tmp_path):
    file = tmp_path / "engine.csv"
    # a straight line from 0.1 g/s at 0 to 1.1 at 20 kW, 5 % above it at 10 kW
    file.write_text("power_kw,fuel_g_per_s\n0,0.1\n10,0.63\n20,1.1\n40,2.3\n")
    made = vehicle_from_map(file, "prius-nimh", "bent")
    lost, at_w = non_convexity(made.line.power_w, made.line.fuel_g_per_s)
    assert lost == pytest.approx(0.05)
    assert at_w == 10e3
    fit = PwaModel.of(made.vehicle).fuel
    assert fit.below >= 0.03 - 1e-9  # the bound holds against the line, not against its envelope


@pytest.mark.parametrize("seed", range(6))
def test_a_scattered_map_has_no_point_below_its_line(seed):
    """Hardly a measured point burns less than the line at its power, which is straight between 201.

    200 points at random are a coarse map: triangles between them are some per cent too high.
    """
    rng = np.random.default_rng(seed)
    speed, torque = rng.uniform(1000, 5000, 200), rng.uniform(5, 130, 200)
    power = torque * speed * np.pi / 30.0
    fuel = 1e-4 * speed + power / 0.42 / LHV
    line = operating_line(Path("scattered"), EngineData(power, fuel, speed, torque, ()))
    assert any("share a speed" in remark for remark in line.remarks)
    inside = (power >= line.power_w[1]) & (power <= line.power_w[-1])
    least = np.interp(power[inside], line.power_w, line.fuel_g_per_s)
    assert np.mean(fuel[inside] >= 0.97 * least) > 0.95
    assert np.all(fuel[inside] >= 0.85 * least)


def test_points_near_a_speed_are_of_that_speed():
    """As a test bench holds it, to some revolutions."""
    speed = np.array([2000.0, 1000, 2006, 1004, 1996, 3000])
    torque = np.array([90.0, 50, 95, 60, 20, 40])
    speeds, least, most = torque_range(speed, torque)
    assert speeds == pytest.approx([1002.0, 2000 + 2 / 3, 3000.0])
    assert least.tolist() == [50.0, 20.0, 40.0]
    assert most.tolist() == [60.0, 95.0, 40.0]


def of_bench(rows) -> EngineData:
    speed, torque, fuel = (np.array(part) for part in zip(*rows, strict=True))
    return EngineData(torque * speed * np.pi / 30.0, fuel, speed, torque, ())


def off(line, least_w: float = 0.0) -> np.ndarray:
    """Line against that of the engine measured, as a share of fuel."""
    at_w = np.linspace(least_w, 70e3, 500)
    return np.interp(at_w, line.power_w, line.fuel_g_per_s) / optimal_line(ENGINE).fuel(at_w) - 1.0


def test_a_bench_that_does_not_hold_its_speed_exactly():
    rng = np.random.default_rng(1)
    rows = []
    for n, torque, _ in bench():
        at = n + rng.normal(0.0, 3.0) * (1200 < n < 5000)
        power = power_w(at, torque)
        rows.append((at, torque, float(fuel_power_w(ENGINE, at, power)) / LHV))
    line = operating_line(Path("jitter"), of_bench(rows))
    assert np.abs(off(line)).max() < 5e-3


def test_no_fuel_is_made_up_where_a_map_has_no_points():
    """Below 2,500 rpm measured from 50 Nm on only: no point in between the two is believed."""
    rows = [row for row in bench() if row[0] > 2500 or row[1] >= 50]
    line = operating_line(Path("ragged"), of_bench(rows))
    assert off(line, 1e3).min() > -3e-3
    assert np.abs(off(line, 13e3)).max() < 3e-3  # from there the best point was measured


def test_a_point_measured_again_counts_in_the_mean(tmp_path):
    rows = bench()
    again = [(n, t, f * share) for share in (0.9, 1.1) for n, t, f in rows]
    for order in (again, again[::-1]):
        line = operating_line(Path("again"), of_bench(order))
        assert np.abs(off(line)).max() < 3e-3
        assert f"{len(rows)} points measured again: the mean counts" in line.remarks


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed,torque_nm,fuel_g_per_s\n1000,50,1\n", "'speed' names no unit, allowed: rpm"),
        ("speed_rpm,torque_nm\n1000,50\n", "one column of fuel, has none"),
        ("speed_rpm,torque_nm,fuel_g_per_s\n1e300,1e300,1\n", "line 2: 'speed_rpm' is '1e300'"),
        ("speed_rpm,torque [ftlb],fuel_g_per_s\n1000,50,1\n", "unit 'ftlb', allowed: nm"),
        ("speed_rpm,torque_nm,rpm,fuel_g_per_s\n1000,50,1000,1\n", "speed is in two columns"),
        ("power_kw,efficiency\n5,0.2\n10,30\n20,35\n", "line 3: fuel is"),
        ("power_kw,fuel_g_per_s\n5,0.4\n10,x\n20,1\n", "line 3: 'fuel_g_per_s' is 'x'"),
        ("power_kw,fuel_g_per_s\n5,0.4\n10\n20,1\n", "line 3: 1 values"),
        ("power_kw,fuel_g_per_s\n5,0.4\n", "1 usable points, at least 3"),
        ("power_kw,fuel_g_per_s\n5,0.4\n10,0.7\n10,0.7\n", "power 10000 W is there twice"),
        ("power_kw,fuel_g_per_s\n0,0.1\n10,0.9\n20,0.8\n", "does not increase with power above 10"),
        ("speed_rpm,torque_nm,fuel_g_per_s\n1e3,50,1\n1e3,60,1.1\n1e3,70,1.2\n", "differ in speed"),
        ("", "needs a header"),
    ],
)  # fmt: skip
def test_what_is_no_engine_is_one_line_that_names_it(text, said, tmp_path):
    file = tmp_path / "engine.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=r"engine\.csv") as caught:
        vehicle_from_map(file, "prius-nimh", "mine")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_of_two_columns_that_say_the_same_one_is_read_and_the_other_named(tmp_path):
    file = tmp_path / "engine.csv"
    file.write_text(
        "speed_rpm,torque_nm,power_kw,fuel_g_per_s,bsfc_g_per_kwh\n"
        "1000,50,9,0.4,1\n1000,100,9,0.8,1\n2000,50,9,0.9,1\n2000,100,9,1.6,1\n"
    )
    data = read_engine_data(file, LHV)
    assert data.fuel_g_per_s.tolist() == [0.4, 0.8, 0.9, 1.6]
    assert data.power_w[0] == pytest.approx(power_w(1000, 50))
    assert data.remarks == (
        "power is that of torque and speed: its own column is not read",
        "bsfc not read, because fuel is there",
    )


def test_points_that_mean_nothing_are_left_out_and_counted(tmp_path):
    file = tmp_path / "engine.csv"
    rates = tmp_path / "rates.csv"
    rates.write_text(
        "rpm,torque_nm,g/s\n0,0,0\n3000,0,0\n-1000,-10,1\n1e3,9,.2\n1e3,90,.7\n2e3,9,.3\n"
    )
    assert read_engine_data(rates, LHV).remarks == (
        "2 of 6 points at speed 0 or below left out",
        "1 of 6 points without fuel left out",
    )
    file.write_text("power_kw,bsfc_g_per_kwh\n-3,0\n0,0\n5,300\n10,\n15,260\n40,230\n60,245\n")
    data = read_engine_data(file, LHV)
    assert data.power_w.tolist() == [5e3, 15e3, 40e3, 60e3]
    assert data.remarks == (
        "1 of 7 points without a value left out",
        "1 of 7 points at which the engine is dragged left out",
        "1 of 7 points without power or bsfc left out",
    )


def test_title_lines_of_several_cells_and_dashes(tmp_path):
    """A header is as wide as the rows; titles above it are not, whatever separates their cells."""
    file = tmp_path / "bench.csv"
    header = "n_mot;Md;Pe;be"
    points = "1000;10;1;400\n1000;80;8,4;250\n4000;30;12;320\n4000;60;25;----\n4000;90;37;260\n"
    file.write_text(f"Bench 4;engine L3;\n2025-03-14;KM\n{header}\n1/min;Nm;kW;g/kWh\n{points}")
    data = read_engine_data(file, LHV)
    assert data.torque_nm.tolist() == [10, 80, 30, 90]
    assert "2 line(s) above the header not read" in data.remarks
    # a row that is too wide stays a row
    file.write_text("rpm,torque_nm,g/s\n1000,10,0.2,7\n2000,10,0.3\n")
    with pytest.raises(InputError, match="line 2: 4 values, but the header has 3 columns"):
        read_engine_data(file, LHV)


def test_the_columns_that_are_there_are_named(tmp_path):
    file = tmp_path / "bench.csv"
    file.write_text("drehzahl,moment,be\n1/min,Nm,g/kWh\n1000,10,400\n")
    with pytest.raises(InputError, match="there are 'drehzahl', 'moment', 'be'; needed are speed"):
        read_engine_data(file, LHV)


def test_a_base_gives_way_to_the_other_description_of_an_engine(tmp_path):
    """A file that brings a line drops its base's map, and the other way round."""
    line = tmp_path / "line.toml"
    line.write_text(
        'base = "prius-nimh"\nname = "line"\n[engine]\npower_max_w = 5e4\n'
        "line_power_w = [0.0, 5e4]\nline_fuel_g_per_s = [0.1, 3.0]\n"
    )
    assert load_vehicle(line).engine.displacement_l is None
    with_speeds = tmp_path / "speeds.toml"
    with_speeds.write_text(line.read_text() + "line_speed_rpm = [1e3, 4e3]\n")
    other = tmp_path / "other.toml"
    other.write_text(line.read_text().replace("prius-nimh", "speeds.toml"))
    assert load_vehicle(other).engine.line_speed_rpm is None
    back = tmp_path / "back.toml"
    of_map = {k: getattr(ENGINE, k) for k in ("displacement_l", "indicated_efficiency")}
    of_map |= {k: list(getattr(ENGINE, k)) for k in (
        "friction_speed_rpm", "friction_kj_per_rev_l", "torque_speed_rpm", "torque_max_nm",
    )}  # fmt: skip
    back.write_text(
        'base = "line.toml"\nname = "back"\n[engine]\n'
        + "".join(f"{key} = {value}\n" for key, value in of_map.items())
    )
    assert load_vehicle(back).engine.line_power_w is None
    both = tmp_path / "both.toml"
    both.write_text(line.read_text() + "displacement_l = 1.5\n")
    with pytest.raises(InputError, match=r"missing: indicated_efficiency"):
        load_vehicle(both)
