"""Two studies compared: runs find their partners, differences are those that were put in."""

import numpy as np
import pytest
from browser import assert_works
from hostile import TEXT, is_harmless
from pages import Page
from synthetic_study import failing, synthetic

from qpmpc.files import json_text
from qpmpc.report.study.pairs import compare_studies, differences
from qpmpc.report.study.pairs_page import comparison_page, comparison_pictures
from qpmpc.report.study.pairs_tables import comparison_markdown
from qpmpc.report.study.write import write_study_comparison

SHIFT = -0.05


def page_of(comparison):
    assert is_harmless(json_text(comparison))
    assert is_harmless(comparison_markdown(comparison))
    return Page(comparison_page(comparison, comparison_pictures(comparison)))


@pytest.fixture(scope="module")
def studies():
    """B has fewer iterations, all trips but the last twenty, and less fuel above dp."""
    frame_a, study_a = synthetic(100, vehicles=["prius-nimh"])
    frame_b, study_b = synthetic(80, vehicles=["prius-nimh"], shift=SHIFT)
    frame_b["set.mh_qp.admm.iterations"] /= 2.0
    frame_a.loc[1, "violations.soc"] = 0.01
    frame_b.loc[4, "violations.t_cl_degc"] = 0.5
    return failing(frame_a, [7]), study_a, frame_b.sample(frac=1.0, random_state=0), study_b


@pytest.fixture(scope="module")
def comparison(studies):
    return compare_studies(*studies)


def group_of(comparison, controller):
    return next(g for g in comparison["groups"] if g["controller"] == controller)


def test_every_run_finds_its_partner(comparison):
    for group in comparison["groups"]:
        found = {key: group[key] for key in ("matched", "only_a", "only_b", "ambiguous")}
        assert found == {"matched": 80, "only_a": 20, "only_b": 0, "ambiguous": 0}
    assert all(pair["run_a"] == pair["run_b"] for pair in comparison["pairs"])


def test_what_is_compared_is_listed(comparison):
    assert comparison["compared"] == [{"setting": "mh_qp.admm.iterations", "a": 50.0, "b": 25.0}]
    assert "set.thermal.t_amb_degc" in comparison["matched_by"]


def test_differences_are_those_put_in(comparison):
    for controller, shift in (("mh-qp", SHIFT), ("dp", 0.0)):
        found = group_of(comparison, controller)["differences"]["above_dp_points"]
        assert found["mean"] == pytest.approx(shift, abs=1e-9)
        assert found["median"] == pytest.approx(shift, abs=1e-9)
        assert found["better"] == (79 if shift else 0)  # one failed in A
        assert found["equal"] == (0 if shift else 80)
    # 79 of 79 of one sign
    p = group_of(comparison, "mh-qp")["differences"]["fuel_percent"]["sign_test_p"]
    assert p == pytest.approx(2.0 * 0.5**79)


def test_failures_and_violations_that_came_and_went(comparison):
    group = group_of(comparison, "mh-qp")
    assert group["failures"] == {"appeared": 0, "vanished": 1}
    assert group["violations"]["soc"] == {"appeared": 0, "vanished": 1}
    assert group["violations"]["t_cl_degc"] == {"appeared": 1, "vanished": 0}


def test_changes_have_both_commands(comparison):
    assert len(comparison["changes"]) == 10
    for change in comparison["changes"]:
        assert "mh_qp.admm.iterations=50" in change["command_a"]
        assert "mh_qp.admm.iterations=25" in change["command_b"]


def test_a_varied_setting_tells_runs_apart(studies):
    frame_a, study_a, *_ = studies
    cold = frame_a.assign(**{"set.thermal.cabin_heat_w": 1000.0})
    warm = frame_a.assign(**{"set.thermal.cabin_heat_w": 2000.0})
    both = warm.assign(run=warm["run"] + len(cold))
    both = type(cold)(cold.to_dict("records") + both.to_dict("records"))
    found = compare_studies(both, study_a, warm, study_a)
    assert sum(group["matched"] for group in found["groups"]) == 300
    assert {pair["run_a"] - pair["run_b"] for pair in found["pairs"]} == {300}
    # without the column in B nothing tells which of the two to take
    found = compare_studies(both, study_a, frame_a, study_a)
    assert sum(group["matched"] for group in found["groups"]) == 0
    assert sum(group["ambiguous"] for group in found["groups"]) == 900
    page_of(found)


def test_other_weather_is_noticed(studies):
    frame_a, study_a, *_ = studies
    other = frame_a.assign(trip_hash="another")
    # the one that failed in A has no trip to compare
    remarks = compare_studies(frame_a, study_a, other, study_a)["remarks"]
    assert any("In 299 of 300 pairs the trip" in remark for remark in remarks)


def test_the_sign_test_rejects_as_often_as_it_says():
    """Of 400 samples without a difference 5 % or fewer, up to three standard errors."""
    rng = np.random.default_rng(3)
    p = [differences(rng.normal(size=60))["sign_test_p"] for _ in range(400)]
    assert np.mean(np.array(p) < 0.05) < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 400)


def test_page(comparison):
    page = page_of(comparison)
    first = page.text.partition("Run by run")[0]
    assert "prius-nimh, mh-qp: B burns" in first
    assert "better in 79, worse in 0 and equal in 0 of 79 pairs" in first
    assert "mh_qp.admm.iterations: 50 against 25" in first
    assert len([tag for tag, _ in page.tags if tag == "img"]) == 1


EDGES = {
    "nothing": lambda frame: frame.iloc[:0],
    "failures": lambda frame: failing(frame, range(len(frame))),
    "strangers": lambda frame: frame.assign(seed=-1),
    "one": lambda frame: frame.iloc[1:2],
    "equal": lambda frame: frame,
    "no dp": lambda frame: frame.assign(fuel_above_dp_percent=None),
    "no figures": lambda frame: frame.assign(comparable=False),
    "hostile": lambda frame: frame.assign(cycle=f"<script>{TEXT}$(rm)", fuel_soc_balanced_g=1.0),
}


@pytest.mark.parametrize("name", EDGES)
def test_nothing_is_too_strange_to_compare(name):
    frame, study = synthetic(10, vehicles=["prius-nimh"])
    other = EDGES[name](frame).reset_index(drop=True)
    for a, b in ((frame, other), (other, other)):
        page = page_of(compare_studies(a, study, b, study))
        assert len(page.programs) == 1


def test_files(tmp_path, studies):
    (line,) = write_study_comparison(*studies, tmp_path)
    assert line.startswith(f"{tmp_path / 'comparison.html'} written")
    names = {file.name for file in tmp_path.iterdir()}
    assert names == {"comparison.html", "comparison.json", "comparison.md", "pairs.png"}
    assert_works(tmp_path / "comparison.html", charts=2, tables=6)
