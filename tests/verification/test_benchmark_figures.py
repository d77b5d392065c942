"""Figures of the benchmark: honest times, a true front, a picture whose names can be read."""

import itertools
from io import BytesIO

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.image import imread
from matplotlib.text import Text

from qpmpc.controllers.settings import ControllerSettings
from qpmpc.cycles import Cycle, load_cycle
from qpmpc.errors import InputError
from qpmpc.solvers import make_solver
from qpmpc.trip import Trip
from qpmpc.vehicle import load_vehicle
from qpmpc.verification.benchmark import candidates as every
from qpmpc.verification.benchmark import growth, on_samples
from qpmpc.verification.benchmark.candidates import chosen_candidates
from qpmpc.verification.benchmark.curves import draw_anytime, draw_growth
from qpmpc.verification.benchmark.drive import spread
from qpmpc.verification.benchmark.on_samples import (
    cold_and_warm,
    generated,
    starts_warm,
    stopped,
)
from qpmpc.verification.benchmark.pareto import front, points
from qpmpc.verification.benchmark.pareto_picture import FAMILY_COLORS, draw_pareto, pareto_figure
from qpmpc.verification.benchmark.sampled import Sample, samples

VEHICLE = load_vehicle()


def row(
    label: str, cycle: str, worst_ms: float, percent: float, sound: bool = True, family="rivals"
):
    return {
        "candidate": label,
        "family": family,
        "cycle": cycle,
        "step_time_ms": {"median": 0.5 * worst_ms, "p99": 0.9 * worst_ms, "max": worst_ms},
        "fuel_above_dp_percent": percent,
        "violations": {"soc": 0.0 if sound else 0.01},
        "fallback_steps": 0,
        "comparable": True,
    }


@pytest.fixture(scope="module")
def sampled() -> list[Sample]:
    nycc = load_cycle("nycc")
    cycle = Cycle("short", np.arange(61.0), nycc.speed_mps[60:121], np.zeros(61))
    return samples(Trip(cycle, VEHICLE), ControllerSettings(), 4)


def test_each_step_counts_with_its_best() -> None:
    times = np.array([[1.0, 9.0, 2.0], [7.0, 3.0, 2.5]])  # two hiccups of the machine
    assert spread(times) == {"median": 2.0, "p99": pytest.approx(2.98), "max": 3.0}
    assert spread(np.full((1, 3), np.nan)) is None
    assert spread(np.empty((0,))) is None


@given(
    st.lists(
        st.tuples(st.integers(1, 9), st.integers(1, 9), st.booleans()), min_size=1, max_size=12
    )
)
def test_front_is_what_nothing_beats(drawn: list[tuple[int, int, bool]]) -> None:
    rows = [row(f"c{i}", "nycc", ms, fuel, sound) for i, (ms, fuel, sound) in enumerate(drawn)]
    found = points(rows)
    best = front(found)
    sound = [p for p in found if p.sound]
    assert all(p.sound for p in best)
    for p in sound:
        beaten = [
            q
            for q in sound
            if (q.worst_ms <= p.worst_ms and q.fuel <= p.fuel)
            and (q.worst_ms < p.worst_ms or q.fuel < p.fuel)
        ]
        if p in best:
            assert not beaten
        else:  # beaten, or a twin of one on the front
            assert beaten or any((q.worst_ms, q.fuel) == (p.worst_ms, p.fuel) for q in best)


def test_rounding_makes_no_front() -> None:
    rows = [row("quick", "nycc", 1.0, 0.1001), row("slow", "nycc", 2.0, 0.1)]
    assert [p.label for p in front(points(rows))] == ["quick"]


def test_worst_step_and_fuel_are_over_all_trips() -> None:
    rows = [row("a", "nycc", 1.0, 0.1), row("a", "udds", 3.0, 0.3), row("a", "us06", 2.0, 0.2)]
    rows[1]["fallback_steps"] = 1
    (point,) = points(rows)
    assert (point.worst_ms, point.median_ms, point.fuel) == (3.0, 1.0, 0.2)
    assert not point.sound


def test_a_controller_without_times_is_on_no_front() -> None:
    without = row("dp", "nycc", 1.0, 0.0)
    without["step_time_ms"] = None
    rows = [row("a", "nycc", 1.0, 0.1), without]
    assert [p.label for p in points(rows)] == ["a", "dp"]
    assert [p.label for p in front(points(rows))] == ["a"]
    draw_pareto(rows)


def test_no_name_lies_over_another_or_over_a_point() -> None:
    """A crowded front: 20 candidates within a decade, each on the front."""
    random = np.random.default_rng(3)
    families = [*FAMILY_COLORS]
    rows = [
        row(
            f"candidate {i}",
            cycle,
            1.08**i,
            10.0 * 0.9**i * random.uniform(1.0, 1.05),
            True,
            families[i % 7],
        )
        for i in range(20)
        for cycle in ("nycc", "udds")
    ]
    figure = pareto_figure(rows)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    plane, times, _ = figure.axes
    boxes = []
    for text in plane.texts:
        text.update_positions(renderer)
        boxes.append(Text.get_window_extent(text, renderer))
    assert len(boxes) >= 5
    for i, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:i])
    marks = plane.transData.transform(
        [(p.worst_ms, np.median(p.above_dp_percent)) for p in points(rows)]
    )
    for box in boxes:
        assert not any(box.contains(x, y) for x, y in marks)
    names = [label.get_window_extent(renderer) for label in times.get_yticklabels()]
    assert not any(a.overlaps(b) for a, b in itertools.pairwise(names))


def test_pictures_are_repeatable_and_show_numbers_not_formulas() -> None:
    rows = [row(f"c{i}", "nycc", 10.0**i, 1.0 / (i + 1)) for i in range(3)]
    figure = pareto_figure(rows)
    FigureCanvasAgg(figure).draw()
    shown = [text.get_text() for axes in figure.axes for text in axes.get_xticklabels()]
    assert {"1", "10", "100"} <= set(shown)
    assert not any("$" in text for text in shown)
    assert draw_pareto(rows) == draw_pareto(rows)


def test_cold_and_warm_are_apart_and_near_the_optimum(sampled: list[Sample]) -> None:
    cold, warm = cold_and_warm(sampled, "hpipm")
    assert (cold["start"], warm["start"]) == ("cold", "warm")
    assert cold["solved"] == warm["solved"] == cold["qps"] == len(sampled) == 4
    assert warm["iterations_max"] < 0.8 * cold["iterations_median"]  # what a warm start is for
    for found in (cold, warm):
        assert found["own_time_ms"]["median"] <= found["solve_time_ms"]["median"]
        assert found["cost_error_g"]["max"] < 0.02  # of 50 g; 1e-5 on each complementarity
        assert found["violation"]["max"] < 1e-4
    assert not starts_warm("clarabel")
    assert [found["start"] for found in cold_and_warm(sampled, "clarabel")] == ["cold"]


def test_reference_is_the_optimum(sampled: list[Sample]) -> None:
    solver = make_solver("clarabel", 1e-9)
    solver.setup(sampled[0].structure, sampled[0].now.data)
    for sample in sampled:
        z = solver.solve(sample.now.data, None, None).primal
        assert abs(sample.cost_error_g(z)) < 1e-5
        assert sample.power_error_w(z) < 1.0


def test_errors_fall_with_iterations_until_it_ends(sampled: list[Sample]) -> None:
    found = stopped(sampled, "hpipm")
    assert found[-1]["solved"] == found[-1]["qps"]  # no more rows after that
    assert all(each["solved"] < each["qps"] for each in found[:-1])
    errors = [each["cost_error_g"]["median"] for each in found]
    assert errors[-1] < 1e-2 * errors[0]
    first_order = stopped(sampled[:2], "osqp")
    assert [each["iterations"] for each in first_order] == list(on_samples.FIRST_ORDER)
    png = draw_anytime([*found, *first_order])
    assert imread(BytesIO(png), format="png").shape[0] > 100
    assert stopped(sampled[:1], "qpoases") == []


def test_generated_c_has_its_own_times_and_the_errors_of_the_same_iterations(
    sampled: list[Sample],
) -> None:
    early = stopped(sampled[:1], "osqp")
    times = {"median": 0.1, "p99": 0.2, "max": 0.3}
    run = {"family": every.GENERATED, "iterations_max": 50, "solve_time_ms": times}
    run |= {"own_time_ms": None, "update_time_ms": times}
    (ours,) = generated([run, {**run, "iterations_max": 51}, {**run, "family": "rivals"}], early)
    (of_osqp,) = [each for each in early if each["iterations"] == 50]
    assert (ours["solver"], ours["errors_of"]) == ("generated C", "osqp")
    assert ours["solve_time_ms"] == times
    assert ours["cost_error_g"] == of_osqp["cost_error_g"]


def test_growth_leaves_out_what_is_too_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "STAGES", (5, 10))
    monkeypatch.setattr(growth, "REPETITIONS", 2)
    times = {"piqp": 1.0, "daqp": 1e3}
    monkeypatch.setattr(growth, "_rival_ms", lambda name, *_: times[name])
    rows = growth.growth(VEHICLE, ControllerSettings().mh_qp, list(times))
    assert [each["rivals_ms"] for each in rows] == [times, {"piqp": 1.0}]
    assert draw_growth(rows).startswith(b"\x89PNG")


def test_a_rival_is_timed_on_growing_qps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "STAGES", (5, 10))
    monkeypatch.setattr(growth, "REPETITIONS", 2)
    rows = growth.growth(VEHICLE, ControllerSettings().mh_qp, ["hpipm"])
    assert all(each["rivals_ms"]["hpipm"] > 0.0 for each in rows)


def test_candidates_by_label_and_controllers_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = chosen_candidates(["hpipm", "osqp K=50", "ecms"])
    assert [(c.solver, c.whole) for c in chosen] == [("hpipm", False), (None, False), (None, True)]
    with pytest.raises(InputError, match=r"unknown candidate 'hpimp', did you mean 'hpipm'") as e:
        chosen_candidates(["hpimp"])
    assert "\n" not in str(e.value)
    with pytest.raises(InputError, match="candidate 'hpipm' is named twice"):
        chosen_candidates(["hpipm", "hpipm"])
    monkeypatch.setattr(every, "find_spec", lambda name: None if name == "qpalm" else True)
    assert every.missing() == ["qpalm"]
    monkeypatch.setattr(casadi, "has_conic", lambda plugin: plugin == "qpoases")
    assert every.missing() == ["hpipm", "qpalm"]
    assert "qpalm" not in [c.label for c in every.candidates()]
