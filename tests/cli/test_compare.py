import pytest

NAMES = "rule-based,mh-qp-paper,mh-qp"
# the engine of the paper: where starts cost something IPOPT takes three times as long
FREE = ("--vehicle", "paper-nimh")


@pytest.fixture
def compared(cli, strict_json, trip):
    done = cli("compare", trip, "--controllers", NAMES, "--json", "-")
    assert done.code == 0
    return strict_json(done.out)["runs"]


def test_runs_are_in_the_order_asked_for(compared):
    assert [run["controller"] for run in compared] == NAMES.split(",")


def test_saving_follows_from_the_balanced_fuel(compared):
    rule = compared[0]["fuel_soc_balanced_g"]
    for run in compared:
        expected = 100.0 * (rule - run["fuel_soc_balanced_g"]) / rule
        assert run["saving_vs_rule_percent"] == pytest.approx(expected, abs=1e-9)
    assert compared[0]["saving_vs_rule_percent"] == 0.0


def test_without_dp_the_distance_from_it_is_null(compared):
    assert [run["fuel_above_dp_percent"] for run in compared] == [None] * 3


def test_without_the_rules_the_saving_is_null(cli, strict_json, trip):
    done = cli("compare", trip, "--controllers", "mh-qp", "--json", "-")
    (run,) = strict_json(done.out)["runs"]
    assert run["saving_vs_rule_percent"] is None


def test_a_run_is_the_same_alone(cli, strict_json, trip, compared):
    alone = strict_json(cli("simulate", trip, "--controller", "mh-qp", "--json", "-").out)
    together = compared[2]
    assert alone["fuel_g"] == together["fuel_g"]
    assert alone["soc_end"] == together["soc_end"]


def test_cycles_are_compared_apart(cli, strict_json, trip):
    other = trip.with_name("other.csv")
    other.write_text(trip.read_text().replace(",14\n", ",13\n"))
    done = cli("compare", trip, other, "--controllers", "rule-based,mh-qp", "--json", "-")
    runs = strict_json(done.out)["runs"]
    assert [(run["cycle"], run["controller"]) for run in runs] == [
        ("short", "rule-based"), ("short", "mh-qp"), ("other", "rule-based"), ("other", "mh-qp"),
    ]  # fmt: skip
    assert runs[0]["saving_vs_rule_percent"] == runs[2]["saving_vs_rule_percent"] == 0.0


@pytest.mark.slow
def test_the_nonlinear_program_is_a_controller_like_others(cli, strict_json, trip, tmp_path):
    done = cli("compare", trip, *FREE, "--controllers", "rule-based,mh-nlp", "--out", tmp_path)
    assert done.code == 0
    rules, nlp = strict_json((tmp_path / "compare.json").read_text())["runs"]
    qp = strict_json(cli("simulate", trip, *FREE, "--json", "-").out)
    assert nlp["controller"] == "mh-nlp"
    assert nlp["fallback_steps"] == 0
    # at most the PWA curves, the expansion and the rounding of the on-share lie between them
    assert nlp["fuel_soc_balanced_g"] == pytest.approx(qp["fuel_soc_balanced_g"], rel=0.02)
    assert nlp["saving_vs_rule_percent"] != rules["saving_vs_rule_percent"]
    page = (tmp_path / "compare.html").read_text("utf-8")
    assert "short_stages" in page  # the horizon, a setting of mh-qp that counts here too


@pytest.mark.slow
def test_settings_of_mh_qp_reach_the_nonlinear_program(cli, strict_json, trip):
    command = ("simulate", trip, *FREE, "--controller", "mh-nlp", "--json", "-")
    low = strict_json(cli(*command).out)["soc_end"]
    high = strict_json(cli(*command, "--set", "mh_qp.qp.terminal_low=1.005").out)["soc_end"]
    assert low == pytest.approx(0.600, abs=0.002)
    assert high == pytest.approx(0.603, abs=0.002)


def test_out_has_everything(cli, strict_json, trip, tmp_path):
    folder = tmp_path / "results"
    done = cli("compare", trip, "--controllers", "rule-based,mh-qp", "--out", folder)
    assert done.code == 0
    assert {file.name for file in folder.iterdir()} == {
        "short_rule-based.csv", "short_mh-qp.csv", "short.png", "compare.json", "compare.html",
    }  # fmt: skip
    assert len(strict_json((folder / "compare.json").read_text())["runs"]) == 2


def test_without_matplotlib_there_are_figures_but_no_pictures(cli, trip, tmp_path, no_matplotlib):
    folder = tmp_path / "results"
    done = cli("compare", trip, "--controllers", "rule-based,mh-qp", "--out", folder)
    assert done.code == 0
    assert {file.name for file in folder.iterdir()} == {
        "short_rule-based.csv", "short_mh-qp.csv", "compare.json",
    }  # fmt: skip
    assert "qpmpc-iptm[plot]" in done.out


def test_dynamic_programming_is_compared_too(cli, strict_json, trip, tmp_path, monkeypatch):
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path / "cache"))
    coarse = ["--set", "dp.soc_step=0.01", "--set", "dp.power_step_w=2000"]
    done = cli("compare", trip, "--controllers", "mh-qp,dp", "--json", "-", *coarse)
    mh_qp, dp = strict_json(done.out)["runs"]
    assert dp["fuel_above_dp_percent"] == 0.0
    ratio = mh_qp["fuel_soc_balanced_dp_g"] / dp["fuel_soc_balanced_dp_g"]
    assert mh_qp["fuel_above_dp_percent"] == pytest.approx(100.0 * (ratio - 1.0), abs=1e-9)
    # it decides nothing from step to step, so it has no step times
    assert dp["step_time_ms"] == {"median": None, "p99": None, "max": None}
    assert dp["violations"] == {"soc": 0.0, "t_cl_degc": 0.0, "power_w": 0.0}
