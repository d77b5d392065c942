"""The report of a study: its figures are those of a known truth, its page is complete and inert."""

import json

import numpy as np
import pytest
from browser import assert_works
from hostile import AS_SHOWN, TEXT, is_harmless
from pages import Page, assert_self_contained
from pandas import DataFrame
from synthetic_study import SCALE, SHIFT_PERCENT, Study, failing, planned, synthetic

from qpmpc.files import json_text
from qpmpc.report.study.factors import factor_table
from qpmpc.report.study.figures import FUEL, SAVING, main_measure, study_table
from qpmpc.report.study.markdown import summary_markdown
from qpmpc.report.study.report import study_page, study_pictures
from qpmpc.report.study.summary import study_summary
from qpmpc.report.study.write import write_study
from qpmpc.simulation import simulate


@pytest.fixture(scope="module")
def frame_and_study():
    frame, study = synthetic(500)
    frame.loc[frame.index[-2], "violations.t_cl_degc"] = 1.5  # of mh-qp
    frame.loc[7, "comparable"] = False  # of mh-qp too
    return failing(frame, [1, 2, 3]), planned(study, 1510)


@pytest.fixture(scope="module")
def summary(frame_and_study):
    return study_summary(*frame_and_study)


@pytest.fixture(scope="module")
def asked():
    """Trips that were asked for again."""
    return []


@pytest.fixture(scope="module")
def written(frame_and_study, asked, tmp_path_factory):
    """The folder of the report, and what was said; the third run cannot be repeated."""
    folder = tmp_path_factory.mktemp("study")

    def rerun(row):
        asked.append((row["controller"], row["trip_hash"]))
        if len(asked) > 2:
            raise ValueError(f"broken {TEXT}")
        return simulate("nycc", "ecms" if row["controller"] == "dp" else "rule-based")

    return folder, write_study(*frame_and_study, folder, rerun)


@pytest.fixture(scope="module")
def page(written):
    return Page((written[0] / "report.html").read_text("utf-8"))


def of(summary, controller):
    return [group for group in summary["groups"] if group["controller"] == controller]


def test_counts(summary):
    assert summary["counts"] == {
        "planned": 1510,
        "done": 1497,
        "failed": 3,
        "missing": 10,
        "not_comparable": 1,
        "with_violation": 1,
        "violations": {"soc": 0, "t_cl_degc": 1, "power_w": 0},
        "with_fallback": 0,
    }


def test_figures_are_those_of_the_truth(summary):
    """With the mean ambient of the four drawn, the lognormal's median and p95, up to sampling."""
    for group in of(summary, "mh-qp"):
        figures = group["measures"]["fuel_above_dp_percent"]
        shift = 0.01 * (15 + 7) / 4
        assert figures["median"] == pytest.approx(SHIFT_PERCENT + shift, rel=0.15)
        p95 = SHIFT_PERCENT * np.exp(1.645 * SCALE) + shift
        assert figures["p95"] == pytest.approx(p95, rel=0.2)
        low, high = figures["p95_ci"]
        assert low < figures["p95"] < high < figures["worst"]
    for group in of(summary, "rule-based"):
        assert group["measures"]["fuel_above_dp_percent"]["mean"] == pytest.approx(10.0)


def test_a_slice_for_each_ambient(summary):
    slices = summary["slices"]["set.thermal.t_amb_degc"]
    warm, cold = (
        np.mean([
            group["measures"]["fuel_above_dp_percent"]["mean"]
            for group in slices
            if group["controller"] == "mh-qp" and group["set.thermal.t_amb_degc"] == ambient
        ])
        for ambient in (10.0, -15.0)
    )  # fmt: skip
    assert cold - warm == pytest.approx(0.15, abs=0.1)  # 0.01 per degree, sampling
    assert sum(group["runs"] for group in slices) == 1500


def test_rank_correlations_find_what_matters():
    frame, study = synthetic(400, cold=0.2)
    table = study_table(frame)
    factors, remarks = factor_table(
        table, study.varied, ["vehicle", "controller"], main_measure(table)[0]
    )
    assert factors[0]["column"] == "set.thermal.t_amb_degc"
    for group in factors[0]["groups"]:
        assert group["correlation"] < -0.8
    # four standard errors of nothing, 1 / sqrt(n - 1)
    for factor in factors[1:]:
        assert all(abs(group["correlation"]) < 4 / np.sqrt(199) for group in factor["groups"])
    assert any(remark.startswith("cycle: too few runs") for remark in remarks)


def test_categories_are_weighed_like_numbers():
    frame, study = synthetic(400, cold=0.2)
    frame["set.mh_qp.solver"] = frame["set.thermal.t_amb_degc"].map(lambda t: f"at {t}")
    table = study_table(frame)
    factors, _ = factor_table(
        table, [*study.varied, "set.mh_qp.solver"], ["controller"], main_measure(table)[0]
    )
    sizes = {f["column"]: abs(f["groups"][0]["correlation"]) for f in factors}
    assert sizes["set.mh_qp.solver"] == pytest.approx(sizes["set.thermal.t_amb_degc"], abs=0.1)


def test_without_dp_the_saving_and_without_rules_the_fuel_is_the_measure():
    assert main_measure(study_table(synthetic(5, controllers=["rule-based", "ecms"])[0]))[0] is (
        SAVING
    )
    assert main_measure(study_table(synthetic(5, controllers=["ecms"])[0]))[0] is FUEL


def test_runs_that_are_not_comparable_are_in_no_fuel_figure():
    frame, study = synthetic(50, vehicles=["prius-nimh"])
    frame.loc[frame["controller"] == "mh-qp", "fuel_above_dp_percent"] = 1.0
    frame.loc[1, ["comparable", "fuel_above_dp_percent"]] = [False, -90.0]
    (group,) = of(study_summary(frame, study), "mh-qp")
    figures = group["measures"]["fuel_above_dp_percent"]
    assert (figures["n"], figures["worst"], figures["mean"]) == (49, 1.0, 1.0)
    assert group["measures"]["fuel_g_per_100km"]["n"] == 49


def test_time_is_told_with_what_is_known():
    frame, study = synthetic(10, vehicles=["prius-nimh"])
    total = frame["wall_s"].sum()
    time = study_summary(frame, study)["time"]
    assert time["runs_per_s"] == pytest.approx(30 / total)
    assert time["share_outside_runs"] is None
    study.provenance.update(elapsed_s=str(total), workers="2")
    time = study_summary(frame, study)["time"]
    assert time["runs_per_s"] == pytest.approx(30 / total)
    assert time["share_outside_runs"] == pytest.approx(0.5)


def test_page_begins_with_question_counts_and_headline(page, frame_and_study):
    first = page.text.partition("Distributions")[0]
    assert frame_and_study[1].description in first
    assert "1,497 runs finished of 1,510 planned. 3 runs failed" in first
    assert "10 runs were not made" in first
    assert "A limit was violated in 1 run: coolant temperature in 1." in first
    assert "Fuel above DP, %" in first
    assert "the solver broke" in page.text


def test_page_stands_alone(page):
    images = [attributes["src"] for tag, attributes in page.tags if tag == "img"]
    # distributions; ambient, duration, distance, speed; the worst run
    assert len(images) == 2 + 4 + 1
    for _, attributes in page.tags:
        assert attributes.get("src", "data:").startswith("data:")
        assert "href" not in attributes


def test_the_worst_are_driven_again_with_dp(frame_and_study, written, asked, page):
    frame, _ = frame_and_study
    worst = frame[(frame["controller"] == "mh-qp") & frame["error"].isna()]
    worst = worst.sort_values("fuel_above_dp_percent", ascending=False)["trip_hash"].tolist()
    # of each the run and dp; those of the second and third end at the first error
    expected = [("mh-qp", 0), ("dp", 0), ("mh-qp", 1), ("mh-qp", 2)]
    assert asked == [(controller, worst[place]) for controller, place in expected]
    (_, *said) = written[1]
    assert all(line in page.text for line in said)
    for line in said[:2]:  # the first and its dp burn something else
        assert "a file that it needs, or the code, has changed" in line
    assert len(said[2:]) == 2
    for line in said[2:]:
        assert "could not be driven again and drawn: ValueError: broken a\\x1b" in line


def test_files(written, summary):
    folder, (line, *_) = written
    assert line.startswith(f"{folder / 'report.html'} written")
    assert json.loads((folder / "summary.json").read_text("utf-8")) == summary
    assert "| prius-nimh | mh-qp |" in (folder / "summary.md").read_text("utf-8")
    pictures = {file.name for file in folder.glob("*.png")}
    assert len(pictures) == 7
    assert "factor_set.thermal.t_amb_degc.png" in pictures


def test_in_a_browser(written):
    assert_works(written[0] / "report.html", charts=7, tables=17)


EDGES = {
    "empty": lambda frame: frame.iloc[:0],
    "no column": lambda frame: DataFrame(),
    "failures only": lambda frame: failing(frame, range(len(frame))),
    "failures only, no figures": lambda frame: DataFrame({
        name: frame[name] for name in ("run", "cycle", "vehicle", "controller", "seed")
    }).assign(error="broken"),
    "one run": lambda frame: frame.iloc[1:2],
    "dp only": lambda frame: frame[frame["controller"] == "dp"],
    "not comparable": lambda frame: frame.assign(comparable=False),
    "constant": lambda frame: frame.assign(fuel_above_dp_percent=1.0, distance_km=1.0),
    "rounding": lambda frame: frame.assign(
        fuel_above_dp_percent=1.0 + 1e-16 * np.arange(len(frame)) % 3
    ),
    "no duration": lambda frame: frame.assign(duration_s=np.nan, distance_km=0.0),
    "all figures missing": lambda frame: frame.assign(
        fuel_above_dp_percent=np.nan, saving_vs_rule_percent=None, fuel_soc_balanced_g=np.nan
    ),
    "many vehicles": lambda frame: frame.assign(vehicle=[f"v{i}" for i in range(len(frame))]),
    "infinite": lambda frame: frame.assign(wall_s=np.inf, engine_starts=-np.inf),
    "forecasts": lambda frame: frame.assign(
        forecast=["true", "speed-noise", None] * 8
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EDGES)
def test_nothing_is_too_strange_to_report(name):
    frame, study = synthetic(12, vehicles=["prius-nimh"], controllers=["mh-qp", "dp"])
    frame = EDGES[name](frame).reset_index(drop=True)
    summary = study_summary(frame, study)
    assert is_harmless(json_text(summary))  # strict JSON: no NaN
    assert is_harmless(summary_markdown(summary))
    # one of the pictures of factors stands for all: they take most of the time
    drawn = study_pictures(frame, summary | {"factors": summary["factors"][:1]})
    assert Page(study_page(frame, study, summary, drawn)).text


def test_hostile_names_are_inert(tmp_path):
    frame, study = synthetic(6, vehicles=[f"{TEXT}<script>", "車" * 300])
    bad = f"<script>alert(1)</script>$(rm){TEXT}'\""
    frame = frame.assign(cycle=bad, forecast=bad, faults="../" + bad)
    frame = frame.rename(columns={"set.thermal.t_amb_degc": f"set.../../{bad}"})
    frame.loc[frame["controller"] == "mh-qp", "controller"] = bad
    frame["duration_s"] = 600.0
    frame = failing(frame, [0, 1], bad)
    study = Study(bad, bad, 1, len(frame), bad, ["set.../../" + bad], {bad: bad})
    remarks = write_study(frame, study, tmp_path / "out")
    assert remarks
    assert [file.name for file in tmp_path.iterdir()] == ["out"]
    source = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert is_harmless(source.replace("\u2026", ""))
    page = Page(source)
    assert_self_contained(source)
    assert "alert" not in page.programs[0]
    assert AS_SHOWN.partition("\n")[0] in page.text
    assert is_harmless((tmp_path / "out" / "summary.md").read_text("utf-8"))
    assert "<script>" not in (tmp_path / "out" / "summary.md").read_text("utf-8")
