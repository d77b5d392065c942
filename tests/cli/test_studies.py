"""``qpmpc sweep``, ``studies`` and ``report``, as a user calls them."""

import json
import subprocess
import sys

import pytest
from quick_study import QUICK, as_toml

from qpmpc.study.results import StudyResults

FEW = {
    **QUICK,
    "grid": {"vehicle": ["prius-nimh", "prius-liion"]},
    "sample": {"count": 2, "values": {"trip.soc_init": {"uniform": [0.55, 0.65]}}},
}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Two folders with the results of one study."""
    folder = tmp_path_factory.mktemp("study")
    file = as_toml(FEW, folder / "few.toml")
    for name in ("a", "b"):
        command = [sys.executable, "-m", "qpmpc", "sweep", file, "--out", folder / name]
        subprocess.run([*command, "--workers", "1"], check=True, capture_output=True)
    return folder


@pytest.mark.slow
def test_two_studies_are_compared(cli, study, tmp_path):
    out = tmp_path / "compared"
    done = cli("report", study / "a", study / "b", "--out", out, "--json", tmp_path / "c.json")
    assert (done.code, done.err) == (0, "")
    assert "rule-based" in done.out
    data = json.loads((tmp_path / "c.json").read_text())
    assert [group["matched"] for group in data["groups"]] == [2, 2]
    assert (out / "comparison.html").exists()


def test_a_report_is_written_whether_or_not_somebody_reads_the_table(study, tmp_path):
    command = [sys.executable, "-m", "qpmpc", "report", study / "a", "--out", tmp_path / "r"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.close()
    assert process.returncode == 0
    assert (tmp_path / "r" / "report.html").exists()


def test_results_are_opened_by_the_name_of_their_folder(study):
    assert len(StudyResults(str(study / "a")).frame()) == 4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--workers", "0"], "1 to 1024"),
        (["--workers", "99999999999"], "1 to 1024"),
        (["--scheduler", "foo"], "no address"),
        (["--scheduler", "inproc://x"], "no address"),
        (["--scheduler", "tcp://127.0.0.1:99999"], "no address"),
        (["--scheduler", "tls://127.0.0.1:1"], "TLS"),
        (["--scheduler", "tcp://127.0.0.1:1", "--workers", "2"], "one of the two"),
    ],
)
def test_wrong_options_are_refused_at_once(cli, study, tmp_path, options, said):
    out = tmp_path / "out"
    cli("sweep", study / "few.toml", "--out", out, *options).assert_refused(said)
    assert not out.exists()


@pytest.mark.parametrize("arguments", [[], ["a"], ["nothing"], ["nothing", "a", "--out", "c"]])
def test_a_report_of_nothing_is_refused(cli, tmp_path, arguments):
    done = cli("report", *[tmp_path / word if word[0] != "-" else word for word in arguments])
    assert done.code == 2
    assert done.err.count("\n") == 1
