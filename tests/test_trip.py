"""A trip: what it is made of, what a controller sees of it, when two are the same."""

import numpy as np
import pytest

from qpmpc import Cycle, InputError, Trip, load_cycle, load_vehicle
from qpmpc.preview import Trace
from qpmpc.trip import as_trip
from qpmpc.vehicle import PlantState

NYCC = load_cycle("nycc")


def part(steps: int, name: str = "part") -> Cycle:
    return Cycle.from_samples(name, NYCC.time_s[: steps + 1], NYCC.speed_mps[: steps + 1])


def test_names_and_objects_make_the_same_trip(tmp_path) -> None:
    by_name, by_object = Trip("nycc", "prius-liion"), Trip(NYCC, load_vehicle("prius-liion"))
    assert by_name.same_as(by_object)
    assert Trip("nycc").vehicle == load_vehicle()
    file = tmp_path / "mine.csv"
    rows = zip(NYCC.time_s.tolist(), NYCC.speed_mps.tolist(), strict=True)
    file.write_text("time_s,speed_mps\n" + "".join(f"{t!r},{v!r}\n" for t, v in rows))
    np.testing.assert_array_equal(Trip(file).truth.speed_mps, by_name.truth.speed_mps)


def test_what_is_seen_is_the_state_and_the_second_ahead() -> None:
    trip = Trip("nycc")
    truth = Trace.of(NYCC, load_vehicle())
    assert trip.steps == truth.steps == NYCC.steps
    for step in (0, 17, trip.steps - 1):
        seen = trip.observation(step, PlantState(0.55, 61.0, True))
        assert (seen.step, seen.soc, seen.t_cl_degc, seen.engine_on) == (step, 0.55, 61.0, True)
        assert (seen.demand_w, seen.speed_mps) == (truth.demand_w[step], truth.speed_mps[step])
    start, of_vehicle = trip.start, trip.vehicle.trip
    assert (start.step, start.engine_on) == (0, False)
    assert (start.soc, start.t_cl_degc) == (of_vehicle.soc_init, of_vehicle.t_cl_init_degc)


def test_forecast_is_the_truth_unless_given() -> None:
    trip = Trip("nycc")
    assert trip.forecast is trip.truth
    expected = part(300)
    other = trip.with_forecast(expected)
    assert (other.steps, other.forecast.steps) == (trip.steps, 300)
    np.testing.assert_array_equal(
        other.forecast.demand_w, Trace.of(expected, load_vehicle()).demand_w
    )
    assert trip.forecast is trip.truth  # the trip itself is never changed
    assert other.with_forecast(None).same_as(trip)
    assert trip.with_forecast(Trace.of(expected, load_vehicle())).same_as(other)


@pytest.mark.parametrize(
    "other",
    [
        Trip("nedc-truncated"),
        Trip("nycc", "prius-liion"),
        Trip("nycc", load_vehicle().with_settings({"trip.soc_init": 0.55})),
        Trip("nycc", forecast=part(300)),
        Trip(part(300, "nycc")),
        Trip(part(NYCC.steps, "another name")),
    ],
    ids=["cycle", "vehicle", "start", "forecast", "length", "name"],
)
def test_any_difference_makes_another_trip(other: Trip) -> None:
    trip = Trip("nycc")
    assert not trip.same_as(other)
    assert not other.same_as(trip)
    assert other.same_as(Trip(other.cycle, other.vehicle, other.forecast))


def test_a_number_that_differs_in_its_last_bit_makes_another_trip() -> None:
    speed = NYCC.speed_mps.copy()
    speed[100] = np.nextafter(speed[100], np.inf)
    assert speed[100] > 0.0
    assert not Trip("nycc").same_as(Trip(Cycle("nycc", NYCC.time_s, speed, NYCC.grade)))


def test_a_trip_brings_its_own_vehicle_and_forecast() -> None:
    trip = Trip("nycc")
    assert as_trip(trip, None, None) is trip
    for vehicle, forecast in (("prius-liion", None), (None, part(300))):
        with pytest.raises(InputError, match=r"give them to Trip\(\.\.\.\)"):
            as_trip(trip, vehicle, forecast)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="nycc"):
        Trip("nyc")
    with pytest.raises(InputError, match="prius-nimh"):
        Trip("nycc", "beetle")
