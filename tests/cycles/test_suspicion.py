"""Parts of genuine cycles, in their own unit and in wrong ones; roads that are too steep."""

import numpy as np
import pytest

from qpmpc import simulate
from qpmpc.cycles import Cycle, cycle_names, load_cycle
from qpmpc.cycles.plausibility import check_motion, check_road
from qpmpc.cycles.suspicion import suspicions
from qpmpc.errors import InputError

PARTS_S = (60, 120, 300)
WRONG = {"km/h": 3.6, "mph": 1 / 0.44704, "knots": 1 / 0.514444}


def outcome(cycle: Cycle) -> str:
    try:
        if cycle.speed_mps.max() > 70:  # as check_samples does
            return "refused"
        check_motion("trip.csv", range(len(cycle.time_s)), cycle.time_s, cycle)
        check_road("trip.csv", cycle)
    except InputError:
        return "refused"
    return "said" if suspicions(cycle) else "silent"


def shares(factor: float, part_s: int, every_s: int) -> dict[str, float]:
    """Shares of the parts of all shipped cycles, their speeds times a factor, by outcome."""
    found = [
        outcome(Cycle("part", np.arange(part_s + 1.0), speed, np.zeros(part_s + 1)))
        for name in cycle_names()
        for whole in [factor * load_cycle(name).speed_mps]
        for k in range(0, len(whole) - part_s, every_s)
        for speed in [whole[k : k + part_s + 1]]
    ]
    return {kind: found.count(kind) / len(found) for kind in ("silent", "said", "refused")}


@pytest.mark.parametrize("part_s", PARTS_S)
def test_nearly_every_part_of_a_genuine_drive_passes_in_silence(part_s):
    """At most 2 % are mentioned: those that creep are slow for a car."""
    found = shares(1.0, part_s, every_s=7)
    assert found["silent"] >= 0.98
    assert found["refused"] == 0.0
    assert all(suspicions(load_cycle(name)) == [] for name in cycle_names())


@pytest.mark.parametrize(
    ("unit", "silent"),
    [
        # at most, of parts of 60, 120 and 300 s
        ("km/h", (0.005, 0.0, 0.0)),
        ("mph", (0.05, 0.005, 0.0)),
        ("knots", (0.19, 0.12, 0.005)),
    ],
)
def test_few_parts_pass_in_a_wrong_unit(unit, silent):
    """Speed alone let 64, 56 and 9 % pass in km/h; a slow, calm part has no other sign."""
    for part_s, most in zip(PARTS_S, silent, strict=True):
        assert shares(WRONG[unit], part_s, every_s=10)["silent"] <= most


@pytest.mark.parametrize(("unit", "silent"), [("km/h", (0.5, 0.2)), ("mph", (0.55, 0.27))])
def test_speeds_too_low_are_noticed_at_their_stops(unit, silent):
    """As m/s or mph that are declared km/h; parts without a stop have no sign."""
    for part_s, most in zip((60, 300), silent, strict=True):
        assert shares(1.0 / WRONG[unit], part_s, every_s=10)["silent"] <= most
    assert all(
        suspicions(Cycle("slow", cycle.time_s, cycle.speed_mps / WRONG[unit], cycle.grade))
        for cycle in map(load_cycle, cycle_names())
    )


@pytest.mark.parametrize("hertz", [0.5, 5.0])
def test_at_other_rates_of_sampling(hertz):
    """Parts of 60 s in mph, sampled at another rate: about as at 1 Hz."""
    silent = []
    for name in cycle_names():
        whole = WRONG["mph"] * load_cycle(name).speed_mps
        for k in range(0, len(whole) - 60, 20):
            time = np.arange(0.0, 60.1, 1.0 / hertz)
            speed = np.interp(time, np.arange(61.0), whole[k : k + 61])
            silent.append(outcome(Cycle.from_samples("part", time, speed)) == "silent")
    assert np.mean(silent) <= 0.07


def sprint(seconds: float) -> Cycle:
    """0 to 100 km/h at constant acceleration, then cruising."""
    time = np.arange(61.0)
    speed = np.minimum(time * 100 / 3.6 / seconds, 100 / 3.6)
    return Cycle("sprint", time, speed, np.zeros(61))


def test_a_fast_car_is_nobodys_mistake():
    assert outcome(sprint(30.0)) == "silent"
    assert outcome(sprint(6.0)) == "said"
    assert outcome(sprint(3.0)) == "said"


def road(grade: np.ndarray, speed_mps: float = 15.0) -> Cycle:
    time = np.arange(float(len(grade)))
    return Cycle("road", time, np.full(len(grade), speed_mps), grade)


WAVES = np.sin(np.arange(601) / 20.0)


@pytest.mark.parametrize(
    ("cycle", "expected"),
    [
        # a level road in percent: +-0.25 % as +-25 %, 16 % in the mean over 9 km
        (road(0.25 * WAVES), "refused"),
        (road(0.25 * WAVES[:100]), "said"),  # 1.5 km: streets of San Francisco
        (road(0.08 * WAVES), "silent"),
        # over a pass: 8 % up for 4.5 km, down again
        (road(np.where(np.arange(601) < 300, 0.08, -0.08)), "silent"),
        # Mount Washington: 11.6 % up, down again, at 50 km/h
        (road(np.where(np.arange(1801) < 900, 0.116, -0.116), 13.9), "silent"),
        # ramps: somebody's test of a car
        (road(np.full(601, 0.3)), "said"),
        (road(np.full(601, 0.08), 30.0), "said"),  # 8 % at 108 km/h
        (road(np.full(601, -0.06), 20.0), "silent"),
    ],
)
def test_roads(cycle, expected):
    assert outcome(cycle) == expected


def test_a_remark_reaches_the_result_and_its_figures(tmp_path):
    file = tmp_path / "fast.csv"
    cycle = sprint(6.0)
    rows = zip(cycle.time_s, cycle.speed_mps, strict=True)
    file.write_text("time_s,speed_mps\n" + "".join(f"{t:.0f},{v:.3f}\n" for t, v in rows))
    run = simulate(file, "rule-based", settings={"rule_based.balance": False})
    (remark,) = [line for line in run.summary()["remarks"] if "unusual" in line]
    assert remark.startswith(f"{file}: unusual for a car: ")
    assert "is the unit of speed right? km/h read as m/s are 3.6 times too fast" in remark
