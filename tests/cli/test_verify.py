"""``qpmpc verify``: table, JSON, report and exit code."""

import json

import pytest
from browser import assert_works
from pages import assert_self_contained

import qpmpc.registry
from qpmpc.verification.checks import Check, Group
from qpmpc.verification.checks.physics_checks import (
    constant_demand,
    engine_covers_demand,
    uncoupled,
)
from qpmpc.verification.checks.pwa_checks import bounds_hold


def wrong(context):
    yield Check("Too much", "This is at most one.", 1.0, 2.0, "g", "<b> & more")


def breaks(context):
    raise ValueError("no such thing")
    yield


def nowhere(context):
    yield Check("Elsewhere", "This runs elsewhere.", 1.0, float("nan"), skipped=True)


@pytest.fixture
def groups(monkeypatch):
    """Only these groups, real ones, because all of them take a minute."""
    chosen = [
        Group("Curves", (bounds_hold,)),
        Group("Physics", (constant_demand, engine_covers_demand, uncoupled)),
    ]

    class Chosen:
        def names(self):
            return tuple(group.title for group in chosen)

        def find(self, name):
            return next(group for group in chosen if group.title == name)

    monkeypatch.setattr(qpmpc.registry, "CHECKS", Chosen())
    return chosen


def test_all_claims_hold(cli, groups, tmp_path, strict_json):
    outcome = cli("verify", "--quick", "--json", "-", "--out", tmp_path / "new")
    assert outcome.code == 0
    data = strict_json(outcome.out)
    assert data["passed"]
    assert data["quick"]
    assert {check["group"] for check in data["checks"]} == {"Curves", "Physics"}
    for check in data["checks"]:
        assert check["verdict"] == "pass"
        assert check["measured"] <= check["tolerance"]
        assert check["claim"].endswith(".")
    assert f"{len(data['checks'])} of {len(data['checks'])} checks passed" in outcome.err
    assert json.loads((tmp_path / "new" / "verify.json").read_text()) == data
    html = (tmp_path / "new" / "verify.html").read_text()
    assert "Constant demand" in html
    assert_self_contained(html)
    assert_works(tmp_path / "new" / "verify.html", charts=0, tables=3)


def test_a_failing_check_makes_the_exit_code_1(cli, groups, tmp_path):
    groups.append(Group("Wrong", (wrong,)))
    outcome = cli("verify", "--out", tmp_path)
    assert outcome.code == 1
    assert "Too much" in outcome.out
    assert "FAIL" in outcome.out
    html = (tmp_path / "verify.html").read_text()
    assert "&lt;b&gt; &amp; more" in html
    assert 'class="name FAIL"' in html


def test_a_check_that_breaks_down_fails_and_the_others_go_on(cli, groups, strict_json):
    groups.insert(0, Group("Broken", (breaks, nowhere)))
    outcome = cli("verify", "--json", "-")
    assert outcome.code == 1
    first, second, *others = strict_json(outcome.out)["checks"]
    assert first["verdict"] == "FAIL"
    assert first["measured"] is None
    assert "ValueError: no such thing" in first["detail"]
    assert second["verdict"] == "skipped"
    assert {check["verdict"] for check in others} == {"pass"}


def test_a_place_that_cannot_be_written_is_noticed_first(cli, tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    outcome = cli("verify", "--out", file)
    assert outcome.code == 2
    assert "--out" in outcome.err
    assert outcome.out == ""
