"""The QP: fixed structure, consistent scaling, and the mathematics it claims."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

from qpmpc.cycles import load_cycle
from qpmpc.preview import HorizonSettings, StageBuilder, Stages, Trace
from qpmpc.pwa import PwaModel
from qpmpc.qp import Linearisation, QpSettings, ScalingSettings, StageQp, Var
from qpmpc.qp.rows import SOC_KEPT
from qpmpc.vehicle import load_vehicle

VEHICLE = load_vehicle()
MODEL = PwaModel.of(VEHICLE)
TRACE = Trace.of(load_cycle("nycc"), VEHICLE)
BUILDER = StageBuilder(VEHICLE, TRACE, TRACE, HorizonSettings())


def _qp(**settings):
    return StageQp(VEHICLE, MODEL, BUILDER.count, QpSettings(**settings), ScalingSettings())


def _about(n=BUILDER.count, t_cl_degc=50.0, fuel=0.3):
    return Linearisation.constant(n, t_cl_degc, fuel)


def _unscaled(qp, data):
    """A, lower, upper and q in SI units."""
    a = qp.structure.matrix_of(data.a_data).toarray()
    s = data.scaling
    return (
        a / s.row[:, None] / s.column[None, :],
        data.lower / s.row,
        data.upper / s.row,
        data.q / s.column / s.cost,
    )


def test_updating_values_equals_building_afresh():
    used = _qp()
    for step in (0, 250, 597, 3):
        used.update(BUILDER.at(step), 0.55 + step / 1e4, 45.0, _about())
    a = used.update(BUILDER.at(120), 0.6, 50.0, _about())
    b = _qp().update(BUILDER.at(120), 0.6, 50.0, _about())
    for field in ("hessian", "q", "a_data", "lower", "upper"):
        np.testing.assert_array_equal(getattr(a, field), getattr(b, field))


@settings(max_examples=40, deadline=None)
@given(
    step=st.integers(0, 597),
    soc=st.floats(0.38, 0.82),
    t_cl_degc=st.floats(-10.0, 95.0),
    fuel=st.floats(0.0, 4.0),
)
def test_values_are_fit_for_a_fixed_iteration_solver(step, soc, t_cl_degc, fuel):
    qp = _qp()
    data = qp.update(BUILDER.at(step), soc, t_cl_degc, _about(t_cl_degc=t_cl_degc, fuel=fuel))
    assert np.isfinite(data.q).all()
    assert np.isfinite(data.a_data).all()
    assert np.all(data.lower <= data.upper)
    # No row may turn into an equality or back (the solver's step size depends on it).
    rows = qp.rows.count
    equality = (data.upper - data.lower < 1e-4).reshape(-1, rows)
    states = [qp.rows.first("soc"), qp.rows.first("t_cl")]
    assert equality[:, states].all()
    assert not np.delete(equality, states, axis=1).any()
    norms = np.sqrt(np.square(qp.structure.matrix_of(data.a_data).toarray()).sum(axis=1))
    np.testing.assert_allclose(norms, 1.0, rtol=1e-12)


def test_masked_stages_pass_the_state_on_at_no_cost():
    stages = BUILDER.at(560)
    qp = _qp()
    a, _, _, q = _unscaled(qp, qp.update(stages, 0.6, 50.0, _about()))
    masked = np.flatnonzero(stages.duration_s == 0.0)
    assert len(masked) > 10
    for k in masked:
        assert q[k * qp.structure.variables + Var.FUEL] == 0.0
        row = a[k * qp.rows.count + qp.rows.first("soc")]
        expected = np.zeros_like(row)
        here = k * qp.structure.variables + Var.SOC
        expected[here], expected[here - qp.structure.variables] = 1.0, -1.0
        np.testing.assert_allclose(row, expected, atol=1e-12)


def _lowest(qp, data):
    """Solve the QP as a linear program (regularisation left out) with an independent solver."""
    a, lower, upper, q = _unscaled(qp, data)
    rows = [
        scipy.optimize.LinearConstraint(a, lower, upper),
    ]
    result = scipy.optimize.milp(q, constraints=rows, bounds=scipy.optimize.Bounds())
    assert result.success
    return result.x.reshape(qp.stages, -1), result.fun


def test_one_stage_optimum_is_the_model_itself():
    # One second, engine forced on by a demand the battery cannot meet: F, G and the states are
    # then the PWA curves and the plant's balances, by hand.
    net = VEHICLE.battery_discharge_max_w + 10e3
    trace = Trace(np.array([net - VEHICLE.battery.aux_power_w]), np.array([20.0]))
    off = trace.internal_off_w(VEHICLE)
    stages = Stages(
        *np.array([[1.0], [net], [20.0]]),
        off,
        np.ones(1),
        np.array([net]),
        off,
        np.ones(1),
        *np.zeros((2, 1)),
    )
    qp = StageQp(VEHICLE, MODEL, 1, QpSettings(terminal_low=0.7), ScalingSettings())
    x, _ = _lowest(qp, qp.update(stages, 0.6, 60.0, _about(1, 60.0, 0.0)))
    sigma, p_eng = x[0, Var.ON], x[0, Var.P_ENG]
    assert sigma >= 0.99
    assert p_eng >= 10e3 - 1e-6
    fuel = (MODEL.fuel.slope * p_eng + MODEL.fuel.intercept * sigma).max()
    assert x[0, Var.FUEL] == pytest.approx(fuel, rel=1e-9)
    energy = MODEL.battery_energy_j
    assert x[0, Var.SOC] == pytest.approx(0.6 - x[0, Var.INTERNAL] / energy, abs=1e-9)


def test_constant_demand_without_thermal_coupling_is_charge_sustaining():
    # Hot engine (alpha = 1), long constant demand at which running the engine all the time at the
    # demand is optimal: battery use only adds losses, so E = P0 in every stage.
    net = 12e3
    n = 6
    off = Trace(np.full(n, net - VEHICLE.battery.aux_power_w), np.zeros(n)).internal_off_w(VEHICLE)
    p0 = np.full(n, net)
    none = np.zeros(n)
    stages = Stages(np.full(n, 10.0), p0, np.full(n, 20.0), off, none, p0, off, none, none, none)
    vehicle = VEHICLE.with_settings({"cold_engine.k": 0.0, "trip.t_cl_init_degc": 70.0})
    model = PwaModel.of(vehicle)
    qp = StageQp(vehicle, model, n, QpSettings(), ScalingSettings())
    data = qp.update(stages, 0.6, 70.0, _about(n, 70.0, 0.5))
    _, cost = _lowest(qp, data)
    at_demand = n * 10.0 * float(model.fuel(net))
    assert cost <= at_demand * (1.0 + 1e-9) + 1.0
    # losses of the PWA battery at zero power are below its error bound: nothing to gain beyond it
    gain = n * 10.0 * model.battery.above * model.fuel.slope.max()
    assert cost >= at_demand - gain - 1e-6


def test_terminal_band_and_reachability():
    qp = _qp(terminal_low=1.0, terminal_high=1.01)
    data = qp.update(BUILDER.at(0), 0.6, 50.0, _about())
    rows = qp.rows
    last = (BUILDER.count - 1) * rows.count + rows.first("box_soc")
    assert data.lower[last] / data.scaling.row[last] == pytest.approx(0.6)
    assert data.upper[last] / data.scaling.row[last] == pytest.approx(0.606)
    # Two seconds before the end with an empty battery the band cannot be met: the limit gives way.
    data = qp.update(BUILDER.at(596), 0.41, 50.0, _about())
    low = data.lower[last] / data.scaling.row[last]
    assert low < 0.44


def test_quadratic_terminal_cost_pulls_to_the_reference():
    qp = _qp(soc_penalty_g=1e4)
    data = qp.update(BUILDER.at(0), 0.6, 50.0, _about())
    assert (data.hessian > 1e-3).sum() == 1
    i = int(np.argmax(data.hessian))
    z = -data.q[i] / data.hessian[i]
    assert z * data.scaling.column[i] == pytest.approx(VEHICLE.trip.soc_init)


def test_scaling_leads_back():
    qp = _qp()
    scaling = qp.update(BUILDER.at(10), 0.6, 50.0, _about()).scaling
    rng = np.random.default_rng(3)
    x = rng.normal(size=scaling.column.shape)
    y = rng.normal(size=scaling.row.shape)
    np.testing.assert_allclose(scaling.primal(scaling.solver_primal(x)), x)
    np.testing.assert_allclose(scaling.dual(scaling.solver_dual(y)), y)


@pytest.mark.parametrize("t_cl_degc", [60.0, 88.0])
def test_ends_of_blocks_keep_a_reserve_of_charge_more_where_the_thermostat_opens(t_cl_degc):
    qp = _qp(soc_reserve=0.5)
    stages = BUILDER.at(0)
    about = _about()
    about = replace(about, t_cl_degc=np.full_like(about.t_cl_degc, t_cl_degc))
    data = qp.update(stages, 0.6, t_cl_degc, about)
    lower = (data.lower / data.scaling.row).reshape(qp.stages, -1)
    planned = lower[:, qp.rows.first("box_soc")]
    battery, trip = VEHICLE.battery, VEHICLE.trip
    share = 0.5 if t_cl_degc > VEHICLE.thermal.thermostat_open_degc else 0.25
    ends = (np.arange(qp.stages) - BUILDER.settings.short_stages) % 3 == 2
    ends[: BUILDER.settings.short_stages] = False
    wanted = share * (trip.soc_init - battery.soc_min) - stages.refill_j / MODEL.battery_energy_j
    reserved = np.where(ends, np.maximum(wanted, 0.0), 0.0)
    swing = stages.fall_j / MODEL.battery_energy_j
    expected = np.maximum(battery.soc_min + SOC_KEPT + swing, -1.0) + reserved  # -1: none
    assert planned[:-1] == pytest.approx(expected[:-1])
    assert planned[-1] == pytest.approx(trip.soc_init)


def test_what_the_road_beyond_refills_needs_no_reserve():
    """Braking beyond the last block but one halves its reserve, and leaves the one before none."""
    qp, steady = _qp(soc_reserve=0.5), BUILDER.at(0)
    ends = np.arange(BUILDER.settings.short_stages + 2, qp.stages, 3)[-3:]
    unit = 0.25 * (VEHICLE.trip.soc_init - VEHICLE.battery.soc_min)  # with a closed thermostat
    internal_off_w = steady.internal_off_w.copy()
    for end, refilled in ((ends[2], 0.5 * unit), (ends[1], 9.0 * unit)):
        of_block = slice(end - 2, end + 1)
        internal_off_w[of_block] = 0.0
        internal_off_w[end] = -refilled * MODEL.battery_energy_j / steady.duration_s[end]
    about = replace(_about(), t_cl_degc=np.full(qp.stages, 60.0))
    data = qp.update(replace(steady, internal_off_w=internal_off_w), 0.6, 60.0, about)
    lower = (data.lower / data.scaling.row).reshape(qp.stages, -1)[:, qp.rows.first("box_soc")]
    swing = steady.fall_j / MODEL.battery_energy_j
    kept = lower - VEHICLE.battery.soc_min - SOC_KEPT - swing
    assert kept[ends[:2]] == pytest.approx([0.0, 0.5 * unit], abs=1e-12)


def test_soc_keeps_the_swing_from_its_limits_at_the_ends_of_blocks_alone():
    qp = _qp(soc_reserve=0.0)
    stages = BUILDER.at(0)
    data = qp.update(stages, 0.6, 60.0, _about())
    row = qp.rows.first("box_soc")
    low, high = (
        (bound / data.scaling.row).reshape(qp.stages, -1)[:-1, row]
        for bound in (data.lower, data.upper)
    )
    short = BUILDER.settings.short_stages
    battery = VEHICLE.battery
    assert low[:short] == pytest.approx(battery.soc_min + SOC_KEPT)
    assert high[:short] == pytest.approx(battery.soc_max)
    ends = np.arange(short + 2, qp.stages - 1, 3)
    inside = np.setdiff1d(np.arange(short, qp.stages - 1), ends)
    assert np.all(low[inside] < 0.0)  # no limit that a battery knows
    assert np.all(high[inside] > 1.0)
    assert np.all(low[ends] < high[ends])
    energy = MODEL.battery_energy_j
    least = battery.soc_min + SOC_KEPT
    assert least + stages.fall_j[ends] / energy == pytest.approx(low[ends])
    assert battery.soc_max - stages.rise_j[ends] / energy == pytest.approx(high[ends])
    assert stages.fall_j[ends].max() > 0.0 < stages.rise_j[ends].max()


def test_limits_that_the_swing_closes_leave_one_soc():
    """Each at most half of the room: with the reserve the lower limit would pass the upper one."""
    stages = BUILDER.at(0)
    half = 0.5 * (VEHICLE.battery.soc_max - VEHICLE.battery.soc_min) * MODEL.battery_energy_j
    closed = replace(
        stages, fall_j=np.full(BUILDER.count, half), rise_j=np.full(BUILDER.count, half)
    )
    qp = _qp(soc_reserve=0.5)
    data = qp.update(closed, 0.6, 60.0, _about())
    assert np.all(data.lower <= data.upper)
