"""The benchmark: honest rows, a usable export, a self-contained report."""

import json
from io import BytesIO

import numpy as np
import pytest
import scipy.sparse as sp
from browser import assert_works
from pages import assert_self_contained

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.solvers import AdmmSettings
from qpmpc.solvers.osqp import Osqp
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.benchmark.benchmark import Benchmark
from qpmpc.verification.benchmark.candidates import Candidate, candidates
from qpmpc.verification.benchmark.drive import drive
from qpmpc.verification.benchmark.export import recorded_npz
from qpmpc.verification.benchmark.on_samples import cold_and_warm, stopped
from qpmpc.verification.benchmark.report import write_benchmark
from qpmpc.verification.benchmark.sampled import samples
from qpmpc.verification.benchmark.table import benchmark_table, solvers_table
from qpmpc.verification.problems.recorder import record

VEHICLE = load_vehicle()


@pytest.fixture(scope="module")
def short():
    nycc = load_cycle("nycc")
    return Cycle("short", np.arange(61.0), nycc.speed_mps[60:121], np.zeros(61))


@pytest.fixture(scope="module")
def driven(short):
    return drive(
        Candidate("osqp K=20", "osqp, fixed K", {"mh_qp.admm.iterations": 20}),
        Trip(short, VEHICLE),
        repetitions=2,
    )


def test_every_step_of_every_repetition_is_timed_and_runs_k_iterations(driven, short):
    assert driven.step_ms.shape == driven.solve_ms.shape == (2, short.steps)
    assert np.all(driven.step_ms >= driven.solve_ms)
    row = driven.row(dp_fuel_g=driven.run.fuel_soc_balanced_g / 1.05)
    assert row["fuel_above_dp_percent"] == pytest.approx(5.0)
    assert row["iterations_max"] == row["iterations_median"] == 20
    assert row["step_time_ms"]["max"] >= row["step_time_ms"]["median"] > 0.0


def test_a_rival_drives_with_its_own_answers(short):
    rival = next(c for c in candidates() if c.label == "piqp")
    row = drive(rival, Trip(short, VEHICLE), repetitions=1).row(1.0)
    assert row["fallback_steps"] == 0
    assert row["iterations_max"] < 200  # an interior-point method, not OSQP in disguise


def test_generated_c_is_timed_and_burns_what_osqp_burns(short, driven):
    overrides = driven.candidate.overrides
    generated = Candidate("generated K=20", "generated C, fixed K", overrides, generated=True)
    again = drive(generated, Trip(short, VEHICLE), repetitions=1)
    assert again.stages == driven.stages
    assert again.solve_ms.shape == again.update_ms.shape == (1, short.steps)
    assert np.all(again.step_ms >= again.solve_ms)
    assert again.run.fuel_soc_balanced_g == pytest.approx(driven.run.fuel_soc_balanced_g, rel=1e-6)


def test_a_whole_controller_drives_as_it_is(short):
    trip = Trip(short, VEHICLE)
    found = drive(Candidate("ecms", "controllers", controller="ecms", whole=True), trip, 1)
    row = found.row(1.0)
    assert row["step_time_ms"]["max"] > 0.0
    assert row["solve_time_ms"] is row["own_time_ms"] is row["stages"] is None
    assert found.run.controller == "ecms"


def test_settings_reach_the_candidates(short):
    settings = ControllerSettings().with_settings({"mh_qp.horizon.blocks": 2})
    few = drive(Candidate("piqp", "rivals", solver="piqp"), Trip(short, VEHICLE), 1, settings)
    assert few.stages == 20 + 3 * 2
    assert few.row(1.0)["own_time_ms"]["max"] <= few.row(1.0)["solve_time_ms"]["max"]


def test_exported_qps_are_the_controllers(short):
    recording = record(Trip(short, VEHICLE))
    with np.load(BytesIO(recorded_npz(recording))) as data:
        steps, n = data["q"].shape
        m = data["lower"].shape[1]
        assert steps == short.steps
        k = 17
        a = sp.csc_matrix((data["a_data"][k], data["a_indices"], data["a_indptr"]), shape=(m, n))
        # Solving the exported numbers from the exported start gives the next exported start.
        qp = recording.on_the_road[k].data
        np.testing.assert_array_equal(
            recording.structure.matrix_of(qp.a_data).toarray(), a.toarray()
        )
        solver = Osqp(AdmmSettings())
        solver.setup(recording.structure, qp)
        solution = solver.solve(qp, data["z_start"][k], data["y_start"][k])
        assert solution.usable
        product = a @ solution.primal
        assert np.all(product <= data["upper"][k] + 0.1)
        assert np.all(product >= data["lower"][k] - 0.1)


def test_report_is_self_contained(driven, short, tmp_path):
    growth = [{"stages": s, "update_ms": 0.1 * s, "solve_ms": 0.2 * s} for s in (5, 50)]
    ecms = Candidate("ecms", "controllers", controller="ecms", whole=True)
    rows = [driven.row(5.0), drive(ecms, Trip(short, VEHICLE), 1).row(5.0)]
    sampled = samples(Trip(short, VEHICLE), ControllerSettings(), 1)
    solvers, anytime = cold_and_warm(sampled, "hpipm"), stopped(sampled, "osqp")
    result = Benchmark([driven], rows, growth, solvers, anytime, ["<qpalm>"])
    write_benchmark(result, VEHICLE, tmp_path)
    page = (tmp_path / "benchmark.html").read_text("utf-8")
    assert_self_contained(page)
    assert "osqp K=20" in page
    for name in ("pareto", "histogram", "anytime", "growth"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    stored = json.loads((tmp_path / "benchmark.json").read_text("utf-8"))
    assert stored["runs"][0]["candidate"] == "osqp K=20"
    assert stored["solvers"][0]["solver"] == "hpipm"
    assert stored["missing_rivals"] == ["<qpalm>"]
    assert "&lt;qpalm&gt;" in page
    assert benchmark_table(result.rows).row_count == 2
    assert solvers_table(result.solvers).row_count == 2
    assert_works(tmp_path / "benchmark.html", charts=5, tables=2)
