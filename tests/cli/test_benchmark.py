"""``qpmpc benchmark`` on a short trip."""

import pytest

pytest.importorskip("casadi")


@pytest.mark.slow
def test_cycles_vehicle_candidates_and_settings_are_chosen(
    cli, trip, strict_json, tmp_path, monkeypatch: pytest.MonkeyPatch
):
    from qpmpc.verification.benchmark import growth

    monkeypatch.setattr(growth, "STAGES", (5, 10))
    monkeypatch.setenv("QPMPC_CACHE_DIR", str(tmp_path))
    done = cli(
        "benchmark",
        trip,
        *("--vehicle", "paper-nimh", "--controllers", "osqp K=50,hpipm,rule-based", "--quick"),
        *("--set", "mh_qp.horizon.blocks=2", "--set", "dp.grid=quick"),
        *("--json", "-"),
    )
    assert done.code == 0
    data = strict_json(done.out)
    assert [run["candidate"] for run in data["runs"]] == ["osqp K=50", "hpipm", "rule-based"]
    assert [run["stages"] for run in data["runs"]] == [26, 26, None]
    assert {row["solver"] for row in data["solvers"]} == {"hpipm"}
    assert {row["solver"] for row in data["anytime"]} == {"osqp", "hpipm"}
    assert [row["stages"] for row in data["growth"]] == [5, 10]
    assert "The same QPs, cold and warm" in done.err


def test_wrong_names_are_one_line_before_any_work(cli, trip):
    cli("benchmark", trip, "--controllers", "hpimp").assert_refused("hpimp", "hpipm", "ecms")
    cli("benchmark", trip, "--set", "mh_qp.nothing=1").assert_refused("nothing")
    cli("benchmark", "no_such_trip").assert_refused("no_such_trip")
