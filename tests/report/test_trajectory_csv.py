"""Trajectories as CSV."""

import csv
from io import StringIO

import numpy as np
import pytest

from qpmpc.report.trajectory_csv import COLUMNS, trajectory_csv

DIMENSIONLESS = {
    "soc", "engine_on", "iterations", "relaxation_gap", "on_share", "fallback", "flags",
}  # fmt: skip
UNITS = ("_s", "_mps", "_w", "_g", "_degc")


@pytest.fixture
def table(runs):
    return list(csv.DictReader(StringIO(trajectory_csv(runs[1]))))


def test_every_column_has_its_unit_in_its_name():
    for column in COLUMNS:
        assert column in DIMENSIONLESS or column.endswith(UNITS)


def test_a_row_a_second_and_the_final_state(table, runs):
    steps = len(runs[1].trajectory.fuel_g)
    assert [int(row["time_s"]) for row in table] == list(range(steps + 1))
    last = table[-1]
    assert float(last["soc"]) == runs[1].trajectory.soc[-1]
    assert {last[column] for column in COLUMNS if column not in ("time_s", "soc", "t_cl_degc")} == {
        ""
    }


@pytest.mark.parametrize("name", ["soc", "t_cl_degc", "p_eng_w", "p_bat_w", "fuel_g", "on_share"])
def test_numbers_read_back_exactly(table, runs, name):
    truth = getattr(runs[1].trajectory, name)
    read = np.array([float(row[name]) for row in table[: len(truth)]])
    np.testing.assert_array_equal(read, truth)


def test_powers_balance(table, runs):
    """P_d + P_aux = P_eng + P_bat - friction, from the columns alone (paper eq. 2)."""
    aux_w = runs[1].vehicle.battery.aux_power_w
    for row in table[:-1]:
        given = float(row["p_eng_w"]) + float(row["p_bat_w"]) - float(row["p_friction_w"])
        assert given == pytest.approx(float(row["demand_w"]) + aux_w, abs=1e-6)


def test_figures_that_a_controller_lacks_are_empty(runs):
    rules = list(csv.DictReader(StringIO(trajectory_csv(runs[0]))))
    assert {row["on_share"] for row in rules} == {""}
