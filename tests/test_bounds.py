"""Every number of vehicle and controllers has bounds, and what is within them runs."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple, get_args, get_origin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from pydantic import BaseModel

from qpmpc import simulate
from qpmpc.controllers.cvxpy_planner import CvxpyPlanner
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle
from qpmpc.errors import InputError
from qpmpc.registry import split_settings
from qpmpc.vehicle import Vehicle, load_vehicle
from qpmpc.vehicle.heat import air_w
from qpmpc.verification.dynamic_programming.settings import DpSettings

VEHICLE = load_vehicle()
JUST = 1e-6  # off a bound that is itself excluded


class Number(NamedTuple):
    """A number by its dotted name, with the least and the greatest value that it may have."""

    name: str
    least: float
    greatest: float
    whole: bool


def numbers(model: type[BaseModel], prefix: str = "") -> Iterator[Number]:
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from numbers(field.annotation, f"{prefix}{name}.")
        elif field.annotation in (int, float):
            yield bounded(prefix + name, field.annotation, field.metadata)
        elif args := get_args(entry_of(field.annotation)):
            # of each entry of an array, or of a number that need not be given
            kind, *metadata = args
            metadata = [part for each in metadata for part in getattr(each, "metadata", [each])]
            entries = "[]" if get_origin(plain(field.annotation)) is tuple else ""
            yield bounded(f"{prefix}{name}{entries}", kind, metadata)


def plain(annotation: Any) -> Any:
    """The type of a value that is given, where it need not be; an array without its own limits."""
    for each in get_args(annotation):
        if get_origin(each) is Annotated and get_origin(get_args(each)[0]) is tuple:
            return get_args(each)[0]
    return annotation


def entry_of(annotation: Any) -> Any:
    return next(iter(get_args(plain(annotation))), None)


def bounded(name: str, kind: type, metadata: list[Any]) -> Number:
    found = {
        side: getattr(part, side)
        for part in metadata
        for side in ("ge", "gt", "le", "lt")
        if getattr(part, side, None) is not None
    }
    least = found.get("ge", found.get("gt", -math.inf) + JUST)
    greatest = found.get("le", found.get("lt", math.inf) - JUST)
    return Number(name, least, greatest, kind is int)


OF_VEHICLE = list(numbers(Vehicle))
OF_CONTROLLERS = [*numbers(ControllerSettings), *numbers(DpSettings, "dp.")]
SCALARS = [n for n in OF_VEHICLE if not n.name.endswith("[]")]
TRIP = Cycle.from_samples(
    "short", [0, 7, 25, 29, 38], [0, 10, 10, 16, 0], [0, 0, 0.02, -0.02, 0]
)  # fmt: skip


def name_of(number: Number) -> str:
    return number.name


def loaded(settings: dict[str, object]) -> None:
    of_vehicle, _ = split_settings(settings)
    VEHICLE.with_settings(of_vehicle)


def refusal(settings: dict[str, object]) -> str:
    """The line that refuses settings; empty if nothing does."""
    try:
        loaded(settings)
    except InputError as error:
        return str(error)
    return ""


def test_all_numbers_are_found():
    assert len(OF_VEHICLE) == 61
    assert len(OF_CONTROLLERS) > 100
    assert "battery.soc_grid[]" in [n.name for n in OF_VEHICLE]


@pytest.mark.parametrize("number", [*OF_VEHICLE, *OF_CONTROLLERS], ids=name_of)
def test_a_number_has_finite_bounds_that_hold(number):
    assert math.isfinite(number.least)
    assert math.isfinite(number.greatest)
    if number.name.endswith("[]"):
        return
    for beyond in (number.least - 2 * JUST, number.greatest * (1 + 1e-9) + 2 * JUST):
        if number.whole:
            beyond = number.least - 1 if beyond < number.least else number.greatest + 1
        line = refusal({number.name: beyond})
        assert line.count(number.name.rpartition(".")[2])
        assert "must be" in line


@pytest.mark.parametrize("number", OF_CONTROLLERS, ids=name_of)
def test_only_finite_numbers_are_numbers_of_controllers(number):
    for wrong in (True, "1", math.nan, math.inf, -math.inf, [1.0], 10**400):
        assert number.name.rpartition(".")[2] in refusal({number.name: wrong})


@pytest.mark.parametrize("number", [*SCALARS, *OF_CONTROLLERS], ids=name_of)
def test_at_its_bounds_a_number_loads_or_a_check_of_several_names_it(number):
    section, _, key = number.name.rpartition(".")
    for value in (number.least, number.greatest):
        line = refusal({number.name: value})
        assert not line or key in line or section.rpartition(".")[2] in line
        assert "must be greater" not in line
        assert "must be less" not in line


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"thermal.heat_capacity_j_per_k": 1e-3}, "greater than or equal to 4000 (given: 0.001)"),
        ({"thermal.heat_capacity_j_per_k": 4e3, "thermal.radiator_w_per_k": 1e3}, "swing within"),
        ({"battery.capacity_ah": 0.02}, "less than a step of 1 s at power_discharge_max_w"),
        ({"battery.derating_share_per_k": 0.055}, "derating_share_per_k = 0.055 takes 0.935 of"),
        ({"battery.soc_min": 0.6, "battery.soc_max": 0.6001}, "less than a step of 1 s"),
        ({"chassis.road_load_b_n_per_mps": math.nan}, "must be a finite number"),
        ({"chassis.road_load_b_n_per_mps": -20.0}, "must not make the road load negative"),
        ({"cold_engine.span_k": 1.0}, "multiply fuel by 544 at -50 degC"),
        ({"engine.torque_speed_rpm": [6e3, 7e3], "engine.torque_max_nm": [99, 99]}, "in common"),
        ({"thermal.t_amb_degc": 30.0, "thermal.thermostat_open_degc": 20.0}, "must be below"),
        ({"thermal.cabin_heat_full_degc": -100.0}, "must be below cabin_heat_full_degc"),
        ({"mh_qp.qp.terminal_high": 0.7}, "mh_qp.qp: terminal_low must not be above terminal_high"),
        ({"rule_based.on_w": 2e3}, "rule_based: off_w must not be above on_w"),
        ({"rule_based.heat_on_degc": 60.0}, "heat_on_degc must not be above heat_off_degc"),
        ({"ecms.factor_min": 6.0}, "ecms: factor_min must not be above factor_max"),
        ({"mh_qp.horizon.class_braking_w": 9e3}, "class_braking_w must not be above class_hard_w"),
        ({"dp.soc_step": 1e-4, "dp.t_cl_step_k": 0.01}, "soc_step, t_cl_step_k make 1e+08 cells"),
        ({"dp.refinement": 256}, "tube_soc, tube_t_cl_k make"),
    ],
)
def test_impossible_combinations(settings, words):
    assert words in refusal(settings)


def test_possible_combinations():
    """Each alone would be refused, or is near to it."""
    loaded({"thermal.heat_capacity_j_per_k": 4e3, "thermal.radiator_w_per_k": 0.0})
    loaded({"chassis.road_load_b_n_per_mps": -5.0})  # of a coast-down's fit
    loaded(
        {
            "battery.capacity_ah": 0.05,  # a capacitor of 8 Wh, at 200 V, for 10 kW
            "battery.power_discharge_max_w": 10e3,
            "battery.power_charge_max_w": 10e3,
        }
    )
    # 0.1 of the battery's power is left, to rounding
    loaded({"battery.derating_share_per_k": 0.015, "thermal.t_amb_degc": -50.0})
    loaded({"battery.derating_share_per_k": 0.1, "thermal.t_amb_degc": 1.0})


@pytest.mark.parametrize("implementation", ["c", "python", "auto"])
@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"mh_qp.qp.terminal_low": 1.4, "mh_qp.qp.terminal_high": 1.5}, "leave no terminal SOC"),
        ({"mh_qp.horizon.blocks": 0, "mh_qp.horizon.block_s": 1}, "into 800 blocks, at most 500"),
    ],
)
def test_what_does_not_fit_a_trip_is_one_line_in_either_implementation(
    implementation, settings, words, capfd
):
    trip = Cycle("long", np.arange(801.0), np.full(801, 10.0), np.zeros(801))
    with pytest.raises(InputError) as caught:
        simulate(trip, settings={**settings, "mh_qp.implementation": implementation})
    assert words in str(caught.value)
    assert capfd.readouterr() == ("", "")  # nor a word of the solver's


FAST: dict[str, object] = {"rule_based.balance": False}
SMALL_QP: dict[str, object] = {
    "mh_qp.implementation": "python",
    "mh_qp.horizon.short_stages": 6,
    "mh_qp.horizon.blocks": 2,
    "mh_qp.admm.cold_iterations": 200,
}


def run_at(controller, settings: dict[str, object]) -> None:
    """Drive with these settings, which may be refused: any result is finite."""
    if refusal(settings):
        return
    try:
        run = simulate(TRIP, controller, settings={**FAST, **settings})
    except InputError:  # of several together, found where the maps are made
        return
    for values in (run.trajectory.soc, run.trajectory.t_cl_degc, run.trajectory.fuel_g):
        assert np.isfinite(values).all()
    assert np.abs(run.trajectory.t_cl_degc).max() < 200.0
    assert -0.2 < run.trajectory.soc.min() <= run.trajectory.soc.max() < 1.2


@pytest.mark.parametrize("controller", ["rule-based", "ecms"])
@pytest.mark.parametrize("number", SCALARS, ids=name_of)
def test_a_car_at_its_bounds_runs(number, controller):
    for value in (number.least, number.greatest):
        run_at(controller, {number.name: value})


@pytest.mark.parametrize(
    "number", [n for n in SCALARS if n.name.startswith("thermal")], ids=name_of
)
def test_coolant_at_its_bounds_runs_with_the_qp(number):
    for value in (number.least, number.greatest):
        run_at("mh-qp", {**SMALL_QP, number.name: value})


SLOW_TO_RUN = ("horizon.short_stages", "horizon.blocks", "iterations", "horizon_s")


@pytest.mark.parametrize(
    "number",
    [n for n in OF_CONTROLLERS if n.name.startswith(("mh_qp.", "ecms", "rule_based"))],
    ids=name_of,
)
def test_a_controller_at_its_bounds_runs(number):
    section = number.name.partition(".")[0]
    settings = SMALL_QP if section == "mh_qp" else {}
    for value in (number.least, number.greatest):
        if value == number.least or not number.name.endswith(SLOW_TO_RUN):
            run_at(section.replace("_", "-"), {**settings, number.name: value})


@examples(max_examples=60, deadline=None)
@given(data=st.data(), controller=st.sampled_from(["rule-based", "ecms", "mh-qp"]))
def test_cars_that_are_odd_in_several_ways_run_or_are_refused(data, controller):
    """Also where a single bound would not show it; hot and empty cars are not refused."""
    odd = data.draw(st.lists(st.sampled_from(SCALARS), min_size=2, max_size=4, unique=True))
    changes = {n.name: data.draw(st.sampled_from([n.least, n.greatest])) for n in odd}
    if refusal(changes):
        return
    try:
        run = simulate(TRIP, controller, settings={**FAST, **SMALL_QP, **changes})
    except InputError:  # what only the plant or a curve can tell
        return
    assert all(np.isfinite(values).all() for values in (run.trajectory.soc, run.trajectory.fuel_g))
    assert np.isfinite(run.trajectory.t_cl_degc).all()


COARSE = {"dp.soc_step": 0.02, "dp.t_cl_step_k": 2.0, "dp.power_step_w": 4e3, "dp.refinement": 2}
WITHOUT = {"thermal.radiator_w_per_k": 0.0, "trip.t_cl_init_degc": 86.0}


@pytest.mark.parametrize("controller", ["c", "python", "rule-based", "ecms", "dp", CvxpyPlanner])
def test_a_car_without_a_radiator_runs(controller):
    settings: dict[str, object] = {**WITHOUT, **FAST}
    if controller in ("c", "python"):
        settings["mh_qp.implementation"] = controller
        controller = "mh-qp"
    elif controller == "dp":
        settings |= COARSE
    run = simulate(TRIP, controller, settings=settings)
    assert not [remark for remark in run.remarks if "drove in" in remark]
    # with the engine off only air and cabin cool
    off, t_cl = ~run.trajectory.engine_on, run.trajectory.t_cl_degc[:-1]
    thermal, speed = run.vehicle.thermal, run.trajectory.speed_mps
    cooling = air_w(thermal, t_cl, speed) + thermal.cabin_heat_w
    np.testing.assert_allclose(run.trajectory.coolant_w[off], -cooling[off], rtol=1e-9)
    assert off.any()
    assert t_cl.max() < 90.0
