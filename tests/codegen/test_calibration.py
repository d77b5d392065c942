"""Numbers in RAM: as code generated anew with them, or refused as a whole and flagged."""

import ctypes
from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qpmpc.codegen.controller import GeneratedController, InputBuilder
from qpmpc.codegen.host_library import HostLibrary, build_host_library
from qpmpc.codegen.method import Generated, Method
from qpmpc.codegen.values import Values
from qpmpc.controllers.monitor import Flag
from qpmpc.controllers.settings import ControllerSettings
from qpmpc.errors import InputError
from qpmpc.simulation import simulate
from qpmpc.trip import Trip
from qpmpc.vehicle import Vehicle, load_vehicle
from qpmpc.vehicle.engine import optimal_line
from qpmpc.vehicle.engine_parameters import MAP, Engine

NAMES: tuple[Generated, ...] = ("mh-qp", "mh-costate")
VEHICLE = load_vehicle()
SECONDS = 80
# other limits, starts, ramp, weights, reserves and rules, by a vehicle and settings
CAR: dict[str, object] = {
    "battery.soc_min": 0.45,
    "battery.soc_max": 0.75,
    "thermal.t_cl_min_degc": 45.0,
    "thermal.t_cl_max_degc": 94.0,
    "engine.start_fuel_g": 0.4,
    "engine.ramp_w_per_s": 9e3,
}
RULES: dict[str, object] = {
    f"rule_based.{name}": value
    for name, value in {
        **{"k_soc_w": 9e4, "on_w": 9e3, "off_w": 2e3, "power_min_w": 9e3, "heat_power_w": 5e3},
        **{"heat_on_degc": 50.0, "heat_off_degc": 53.0, "soc_ref_offset": 0.01, "soc_forced": 0.5},
    }.items()
}
# what the car could have done within a second, for the plausibility of measurements, is not tuned
ELSEWHERE = {"can_soc_per_s", "can_t_cl_k_per_s"}


def method(name: Generated, changed: bool = False) -> Method:
    section, limits = ("mh_qp", "qp") if name == "mh-qp" else ("mh_costate", "limits")
    own: dict[str, object] = {
        f"{section}.horizon.rise_share": 0.5,
        f"{section}.{limits}.soc_reserve": 0.2,
        f"{section}.{limits}.slack_g_per_k": 20.0,
        f"{section}.{limits}.t_cl_margin_k": 0.8,
        f"{section}.{limits}.terminal_high": 1.02,
    }
    return Method.of(name, ControllerSettings().with_settings({**own, **RULES} if changed else {}))


def page(values: Values) -> dict[str, float]:
    return {entry.name: entry.default for entry in values.calibration.entries}


def other_numbers(one: Values, two: Values) -> set[str]:
    """Names of numbers outside the calibration in which two controllers differ."""
    found = set()
    for kind in ("scalars", "arrays", "counts"):
        mine, its = getattr(one, kind), getattr(two, kind)
        assert mine.keys() == its.keys()
        found |= {name for name in mine if not np.array_equal(mine[name], its[name])}
    rest = {f.name for f in fields(Values)} - {"scalars", "arrays", "counts", "calibration"}
    return found | {name for name in rest if getattr(one, name) != getattr(two, name)}


class Driven:
    """One library with its state, asked second by second."""

    def __init__(self, library: HostLibrary, numbers: Mapping[str, float] | None = None) -> None:
        self.library = library
        self.state = ctypes.create_string_buffer(library.state_bytes)
        library.init(self.state)
        library.calibrate(self.state, numbers or {})
        self.out = library.output_type()

    def step(self, inputs: Any) -> Any:
        self.library.step(self.state, ctypes.byref(inputs), ctypes.byref(self.out))
        return self.library.output_type.from_buffer_copy(self.out)


def driven(trip: Trip, of: Method, *libraries: Driven) -> Iterator[tuple[Any, ...]]:
    """Outputs of several second by second, in the loop of the first."""
    builder = InputBuilder(trip.preview(of.horizon).receive)
    inputs, state = libraries[0].library.input_type(), trip.plant.initial_state()
    for left in libraries:
        builder.fill(trip.start, inputs)
        while left.library.depart(left.state, ctypes.byref(inputs)) > 0:
            pass
    for k in range(min(SECONDS, trip.steps)):
        seen = trip.observation(k, state)
        builder.fill(seen, inputs)
        outs = tuple(each.step(inputs) for each in libraries)
        yield outs
        state, _ = trip.plant.step(
            state, of.decision(outs[0]).command, seen.demand_w, seen.speed_mps
        )


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_number_is_as_code_generated_anew_with_it(name) -> None:
    """To the bit: nothing else is made of them."""
    car = VEHICLE.with_settings(CAR)
    before, after = method(name), method(name, changed=True)
    old, new = before.values(VEHICLE, None), after.values(car, None)
    assert other_numbers(old, new) == ELSEWHERE
    kept = {key: old.scalars[key] for key in ELSEWHERE}
    new = replace(new, scalars=new.scalars | kept)
    numbers = page(new)
    changed = {key for key, value in page(old).items() if value != numbers[key]}
    assert {*numbers} - changed == {"fuel_scale", "on_threshold"} | {
        key for key in numbers if key.startswith(("search_", "terminal_soc_low"))
    }
    anew = Driven(build_host_library(new))
    in_ram = Driven(build_host_library(old), numbers)
    as_was = Driven(build_host_library(old))
    same = 0
    for first, second, third in driven(Trip("nycc", car), after, anew, in_ram, as_was):
        assert bytes(first) == bytes(second)
        assert first.flags == 0
        same += bytes(first) == bytes(third)
    assert same < SECONDS // 2  # they do change the trip


def scaled(vehicle: Vehicle, factor: float) -> Vehicle:
    """The car with its engine given by its line, at so many times the fuel."""
    line = optimal_line(vehicle.engine)
    data = vehicle.engine.model_dump(exclude=set(MAP), exclude_none=True)
    data |= {
        "line_power_w": tuple(line.power_w[::20].tolist()),
        "line_fuel_g_per_s": tuple((factor * line.fuel_g_per_s[::20]).tolist()),
    }
    return vehicle.model_copy(update={"engine": Engine.model_validate(data)})


@pytest.mark.parametrize("name", NAMES)
def test_the_factor_on_the_fuel_map_is_as_another_map(name) -> None:
    """To rounding; the plan's reserve of heat, made of the map, is a number of its own.

    The chords of a second are fitted to so many g/s: here those of before, scaled.
    """
    of, car = method(name), scaled(VEHICLE, 1.1)
    old, new = (method(name).values(scaled(VEHICLE, factor), None) for factor in (1.0, 1.1))
    chords = {key: value for key, value in old.arrays.items() if key.startswith("line_")}
    for key in ("line_slope", "line_intercept"):
        chords[key] = 1.1 * chords[key]
    if name == "mh-costate":
        rows = old.arrays["shared"].reshape(-1, 4) * [1.1, 1.0, 1.0, 1.1]  # slope, ends, intercept
        chords["shared"] = rows.ravel()
    new = replace(new, arrays=new.arrays | chords, sizes=old.sizes, costate=old.costate)
    numbers = page(new) | {"fuel_scale": 1.1}
    anew = Driven(build_host_library(new))
    in_ram = Driven(build_host_library(old), numbers)
    as_was = Driven(build_host_library(old))
    apart, changed = [], []
    for first, second, third in driven(Trip("nycc", car), of, anew, in_ram, as_was):
        apart.append(abs(first.p_eng_w - second.p_eng_w))
        changed.append(abs(first.p_eng_w - third.p_eng_w))
        assert first.flags == 0
    assert max(apart) < 1e-3 < 10.0 < max(changed)


BAD = [
    ("soc_min", float("nan"), "soc_min"),
    ("slack_g_per_k", float("inf"), "slack_g_per_k"),
    ("fuel_scale", 2.1, "fuel_scale"),
    ("on_threshold", -1e300, "on_threshold"),
    ("soc_min", 0.79, "soc_min"),  # too near to soc_max
    ("soc_max", 0.41, "soc_min"),  # of two the lower one is named
    ("terminal_soc_high", 0.59, "terminal_soc_low"),
    ("t_max_degc", 90.5, "t_max_degc"),  # above the limit itself
    ("rule_off_w", 9001.0, "rule_off_w"),
]


@pytest.mark.parametrize("name", NAMES)
def test_a_wrong_number_is_refused_and_the_last_good_ones_stay(name) -> None:
    """Each in turn, beside a good one that must not be taken over alone; then all is well."""
    of, values = method(name), method(name).values(VEHICLE, None)
    library = build_host_library(values)
    good = {"soc_reserve": 0.05, "rule_on_w": 9e3}
    untouched, attacked = Driven(library, good), Driven(library, good)
    for k, outs in enumerate(driven(Trip("nycc"), of, untouched, attacked)):
        first, second = outs
        wrong = BAD[k - 2] if 2 <= k < 2 + len(BAD) else None
        assert second.flags == (Flag.BAD_CALIBRATION if wrong else 0)
        assert second.wrong_entry == (values.calibration.place(wrong[2]) if wrong else -1)
        second.flags, second.wrong_entry = first.flags, first.wrong_entry
        assert bytes(first) == bytes(second)
        library.calibrate(attacked.state, page(values) | good)
        if 1 <= k < 1 + len(BAD):
            entry, number, _ = BAD[k - 1]
            library.calibrate(attacked.state, {"t_cl_min_degc": 40.05, entry: number})


@pytest.mark.parametrize(
    ("vehicle", "precision"), [("sonata-hybrid", "f32"), ("prius-prime", "f64")]
)
def test_every_bound_and_default_is_accepted(vehicle, precision) -> None:
    """One at a time, as far as those that it has to stay apart from allow."""
    values = method("mh-costate").values(load_vehicle(vehicle), None)
    library = build_host_library(values, precision)
    own = page(values)
    inputs = library.input_type()  # no preview: the rules drive

    def refused(numbers: Mapping[str, float]) -> bool:
        one = Driven(library, numbers)
        return bool(one.step(inputs).flags & Flag.BAD_CALIBRATION)

    assert not refused({})
    for entry in values.calibration.entries:
        least, most = entry.least, entry.most
        for order in values.calibration.orders:
            if order.high == entry.name:
                least = max(least, own[order.low] + 1.001 * order.gap)
            if order.low == entry.name:
                most = min(most, own[order.high] - 1.001 * order.gap)
        assert not refused({entry.name: least}), entry
        assert not refused({entry.name: most}), entry
        beyond = 1e-6 * max(abs(entry.most), 1.0)
        assert refused({entry.name: entry.least - beyond}), entry
        assert refused({entry.name: entry.most + beyond}), entry


def test_the_documented_numbers_are_those_of_the_code() -> None:
    text = (Path(__file__).parents[2] / "docs" / "calibration.md").read_text("utf-8")
    found = [line for line in text.splitlines() if line.startswith("| `")]
    of_qp, of_costate = (method(name).values(VEHICLE, None).calibration for name in NAMES)

    def either(one: float, two: float) -> str:
        return f"{one:g}" if one == two else f"{one:g} (mh-qp), {two:g}"

    defaults = {entry.name: entry.default for entry in of_qp.entries}
    rows = [
        f"| `{e.name}` | {e.unit} | {either(defaults.get(e.name, e.default), e.default)} | "
        f"{e.least:g} to {e.most:g} | {e.what} |"
        for e in of_costate.entries
    ]
    rows += [
        f"| `{two.low}` | `{two.high}` | {either(one.gap, two.gap)} |"
        for one, two in zip(of_qp.orders, of_costate.orders, strict=True)
    ]
    assert found == rows


def test_a_simulation_with_other_numbers(tmp_path) -> None:
    trip = Trip("nycc")
    plain, warmer = GeneratedController(trip), GeneratedController(trip)
    warmer.calibrate({"t_cl_min_degc": 48.0, "t_min_degc": 49.0})
    assert simulate(trip, warmer).trajectory.t_cl_degc[60:].min() > 47.9
    assert simulate(trip, plain).trajectory.t_cl_degc[60:].min() < 47.0
    with pytest.raises(InputError, match="soc_min"):
        warmer.calibrate({"soc_mim": 0.5})
