"""A user's program in generated C drives like the program in cvxpy."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

import qpmpc
from qpmpc import CvxpyPlanner, Cycle, Observation, Plan, Trip, load_cycle, load_vehicle
from qpmpc.codegen import from_cvxpy
from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.from_cvxpy import in_c, write_c
from qpmpc.errors import InputError

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")
# Both solve to 1e-7 of 10 kW; where two powers cost nearly the same they may differ by more.
SAME_W = 1.0
SECONDS = 60


class Mine(CvxpyPlanner):
    """Everything that a term may have: a state, a quantity, a parameter that changes, an own
    variable."""

    name = "mine"

    def terms(self, program: Any) -> Any:
        self.price = cp.Parameter(name="price", nonneg=True)
        self.energy = program.state("energy_mj")
        above_kw = cp.Variable(20, name="above", nonneg=True)
        of_stage = cp.multiply(program.given("duration_s"), program.p_eng_w / 1e6)
        change_kw = cp.diff(program.p_eng_w[:20]) / 1e3
        return self.price * cp.sum(above_kw) + 0.002 * cp.norm1(change_kw), [
            above_kw >= program.p_eng_w[:20] / 1e3 - 12.0,
            self.energy.end == self.energy.before + of_stage,
        ]

    def plan(self, seen: Observation) -> Plan:
        self.price.value = 0.001 * (1 + seen.step % 5)
        self.energy.now.value = 0.1
        return super().plan(seen)


@pytest.fixture(scope="module")
def trip() -> Trip:
    cycle = load_cycle("nycc")
    part = [values[: SECONDS + 1] for values in (cycle.time_s, cycle.speed_mps, cycle.grade)]
    return Trip(Cycle("part", *part), load_vehicle("prius-nimh"))


@pytest.mark.slow
@needs_compiler
def test_the_same_commands_as_cvxpy(trip: Trip) -> None:
    pytest.importorskip("cvxpygen")
    first, second = qpmpc.simulate(trip, Mine), qpmpc.simulate(trip, in_c(Mine))
    assert (second.controller, second.solver) == ("mine-c", "cvxpygen qoco")
    assert second.summary()["fallback_steps"] == 0
    ours, theirs = first.trajectory, second.trajectory
    assert ours.engine_on.any()
    np.testing.assert_array_equal(ours.engine_on, theirs.engine_on)
    np.testing.assert_allclose(theirs.p_eng_w, ours.p_eng_w, rtol=0.0, atol=SAME_W)


@needs_compiler
@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
def test_the_project_builds_by_its_makefile_and_without_parameters_of_python(
    trip: Trip, tmp_path: Path
) -> None:
    pytest.importorskip("cvxpygen")
    planner = Mine(trip)
    planner.price.value = planner.energy.now.value = 0.0
    folder = write_c(planner, tmp_path / "project")
    header = (folder / "program.h").read_text("utf-8")
    parameters = sum(one.size for one in planner.program.problem.parameters())
    assert f"#define PROGRAM_PARAMETERS {parameters}\n" in header
    command = ["make", "-s", "CFLAGS=-O0 -w -std=gnu99"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    assert (folder / "libprogram.a").exists()


def test_without_cvxpygen_the_extra_is_named(trip: Trip, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(from_cvxpy, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="qpmpc-iptm\\[prototype\\]"):
        in_c(Mine)(trip)
