"""What is said of a fault: against two runs made by hand."""

from dataclasses import replace

import pytest

from qpmpc import Trip, simulate
from qpmpc.faults.effects import effect, fuel_change, sentences
from qpmpc.faults.models import Fault


@pytest.fixture(scope="module")
def unfaulted():
    return simulate(Trip("nycc"), "ecms")


def moved(run, at_s, to_s, soc=0.0, t_cl_k=0.0, fuel_g=0.0):
    """The run with SOC and coolant moved in some seconds, and more fuel in the first of them."""
    trajectory = replace(
        run.trajectory,
        soc=run.trajectory.soc.copy(),
        t_cl_degc=run.trajectory.t_cl_degc.copy(),
        fuel_g=run.trajectory.fuel_g.copy(),
        fallback=list(run.trajectory.fallback),
        flags=run.trajectory.flags.copy(),
    )
    trajectory.soc[at_s:to_s] += soc
    trajectory.t_cl_degc[at_s:to_s] += t_cl_k
    trajectory.fuel_g[at_s] += fuel_g
    return replace(run, trajectory=trajectory)


FAULT = Fault(kind="reset", at_s=100, for_s=3)


@pytest.mark.parametrize(("soc", "t_cl_k"), [(2e-3, 0.0), (-2e-3, 0.0), (0.0, 0.2), (0.0, -0.2)])
def test_the_trajectory_is_met_again_when_soc_and_coolant_are_near(unfaulted, soc, t_cl_k):
    found = effect(FAULT, moved(unfaulted, 101, 140, soc, t_cl_k), unfaulted)
    assert found["met_again_s"] == 140
    assert sum(found["drove"].values()) == 40
    end = len(unfaulted.trajectory.soc)
    assert effect(FAULT, moved(unfaulted, 101, end, soc, t_cl_k), unfaulted)["met_again_s"] is None


def test_a_trajectory_that_stays_near_was_never_left(unfaulted):
    found = effect(FAULT, moved(unfaulted, 101, 140, 0.9e-3, 0.09), unfaulted)
    assert found["met_again_s"] == FAULT.at_s
    assert sum(found["drove"].values()) == FAULT.for_s
    assert "never left" in sentences({"each": [found]})[0]


def test_rungs_flags_and_fuel(unfaulted):
    faulted = moved(unfaulted, 101, 110, 2e-3, fuel_g=0.5)
    faulted.trajectory.fallback[100:104] = ["shifted plan", "shifted plan", "rule-based", ""]
    faulted.trajectory.flags[100:103] = [4, 4, 12]
    faulted.trajectory.flags[300] = 1  # long after
    found = effect(FAULT, faulted, unfaulted)
    assert found["drove"] == {"shifted plan": 2, "rule-based": 1, "own decision": 7}
    assert found["flags"] == {"solver failed": 3, "warming up": 1}
    assert found["fuel_g"] == pytest.approx(0.5)
    percent = 100 * 0.5 / unfaulted.fuel_soc_balanced_g
    assert found["fuel_percent"] == pytest.approx(percent)
    assert found["violations"] == {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}
    faulted.trajectory.power_excess_w = faulted.trajectory.power_excess_w + 70.0
    faulted = replace(faulted)  # without what the run has remembered of its limits
    assert effect(FAULT, faulted, unfaulted)["violations"]["power_w"] == 70.0


def test_charge_left_in_the_battery_is_no_cost(unfaulted):
    """Fuel burnt for charge that is there at the end is worth what the correction says."""
    end = len(unfaulted.trajectory.soc)
    charged = moved(unfaulted, 101, end, soc=0.01)
    assert fuel_change(charged, unfaulted)["fuel_g"] < 0.0


def test_several_faults_have_runs_of_their_own_and_one_together():
    faults = [{"kind": "reset", "at_s": t, "for_s": 5} for t in (200, 400)]
    trip = Trip("nycc")
    both = simulate(trip, faults=faults)
    alone = [simulate(trip, faults=[fault]) for fault in faults]
    assert both.faults["each"] == [run.faults["each"][0] for run in alone]
    plain = simulate(trip)
    assert both.faults["fuel_g"] == both.fuel_soc_balanced_g - plain.fuel_soc_balanced_g
    assert both.faults["unfaulted_fuel_soc_balanced_g"] == plain.fuel_soc_balanced_g
    assert both.faults["fuel_g"] > 0.0
    assert alone[0].faults["fuel_g"] == both.faults["each"][0]["fuel_g"]
    lines = sentences(both.faults)
    assert len(lines) == 3
    assert "all 2 faults together" in lines[-1]
