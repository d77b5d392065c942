"""A second that would empty the battery runs the engine at the power of least cost."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from short_trip import assert_same_commands, drive_in

import qpmpc
from qpmpc.codegen.c_compiler import compiler
from qpmpc.controllers.empty_battery import empties, empty_battery_w
from qpmpc.controllers.safety import SOC_MARGIN
from qpmpc.pwa import PwaModel
from qpmpc.qp.polish import Polish, Prices
from qpmpc.trajectory import Trajectory
from qpmpc.vehicle import Command, Plant, PlantState, load_vehicle

CAR = load_vehicle("paper-liion")
PLANT, LIMIT = Plant(CAR), CAR.battery.soc_min
POLISH = Polish(CAR, PwaModel.of(CAR))
PRICES = Prices(fuel=1.0, p_eng=0.0, internal=9e-5)  # g/g, g/J: see test_last_run.py
LOW = {
    "thermal.t_amb_degc": -2.486434,
    "trip.soc_init": 0.419465,
    "trip.t_cl_init_degc": 81.602422,
}
POOR_W = 4e3  # half the power of least consumption and less: a third more fuel per kWh


@given(above=st.floats(0.0, 0.01), demand_w=st.floats(-20e3, 20e3))
def test_it_empties_where_the_plant_ends_below_the_limit(above: float, demand_w: float) -> None:
    soc = LIMIT + SOC_MARGIN + above
    net_w = demand_w + CAR.battery.aux_power_w
    after, _ = PLANT.step(PlantState(soc, 60.0), Command(False, 0.0), demand_w, 10.0)
    if abs(after.soc - LIMIT - SOC_MARGIN) < 1e-9:
        return  # rounding decides
    found = empties(CAR.battery, POLISH.maps, net_w, soc)
    assert found is bool(after.soc < LIMIT + SOC_MARGIN)
    least_w = POLISH.power_w(PRICES, net_w, 0.0)
    asked = [
        empty_battery_w(CAR.battery, POLISH.maps, net_w, soc, least_w, ramp_w)
        for ramp_w in (0.0, 9e3)
    ]
    assert asked == [least_w if found else 0.0, max(least_w, 9e3)]


def drive(made_in: str) -> Trajectory:
    return drive_in(made_in, "random-9055-165s", "paper-liion", LOW)


def test_no_second_at_the_limit_is_driven_at_a_poor_power(monkeypatch) -> None:
    """Five seconds of less than 4 kW before; now at the power of least consumption."""
    now = drive("python")
    monkeypatch.setattr("qpmpc.controllers.coming_second.empty_battery_w", lambda *_: 0.0)
    before = drive("python")
    poor = [int((run.engine_on & (run.p_eng_w < POOR_W)).sum()) for run in (now, before)]
    assert poor[0] == 0
    assert poor[1] == 5
    assert now.soc.min() >= LIMIT
    soc_g = 162.0  # of a unit of SOC with this battery: see test_last_run.py
    fuel_g = [run.fuel_g.sum() - soc_g * (run.soc[-1] - run.soc[0]) for run in (now, before)]
    assert fuel_g[1] > 1.03 * fuel_g[0]


def test_a_plan_at_the_lower_limit_starts_no_engine_for_a_few_watts(monkeypatch) -> None:
    """It rides above the limit; at it the safety layer started the engine for 4 s at idle."""
    known = {"thermal.t_amb_degc": 7.562969, "trip.soc_init": 0.415593}
    known |= {"trip.t_cl_init_degc": 79.839776, "mh_qp.implementation": "python"}

    def least_of_runs_w() -> float:
        run = qpmpc.simulate("random-7414-169s", "mh-qp", vehicle="prius-liion", settings=known)
        on, power_w = run.trajectory.engine_on, run.trajectory.p_eng_w
        begins = np.flatnonzero(on & ~np.concatenate([[False], on[:-1]]))
        return min(float(power_w[begin : begin + 4].mean()) for begin in begins)

    assert least_of_runs_w() > POOR_W
    # a run in good time for what the battery lacks would hide it: test_battery_run.py
    monkeypatch.setattr("qpmpc.controllers.coming_second.battery_run_w", lambda *_: 0.0)
    assert least_of_runs_w() > POOR_W
    monkeypatch.setattr("qpmpc.qp.rows.SOC_KEPT", 0.0)
    assert least_of_runs_w() < 200.0


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_c_runs_as_python_does() -> None:
    runs = [drive(made_in) for made_in in ("python", "c")]
    assert_same_commands(*runs)
