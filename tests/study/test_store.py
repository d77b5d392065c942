"""A study's folder: what is written stays, and is read once."""

import json
import shutil
from pathlib import Path
from typing import Any

import pyarrow.parquet as parquet
import pytest

from qpmpc.errors import InputError
from qpmpc.study import store as module
from qpmpc.study.load import as_study
from qpmpc.study.results import StudyResults
from qpmpc.study.store import JOURNAL, PARTS, SESSIONS, Store, part_files

STUDY = as_study(
    {
        "name": "small",
        "fixed": {"cycle": "nycc"},
        "grid": {"trip.soc_init": [0.1 * i for i in range(9)]},
    }
)
IDENTITY = {"runs": "a", "code": "b", "versions": "numpy 2"}


def row(run: int, **more: Any) -> dict[str, Any]:
    return {"run": run, "cycle": "nycc", "controller": "mh-qp", "fuel_g": run / 3.0, **more}


def opened(folder: Path, **more: Any) -> Store:
    return Store(folder, STUDY, IDENTITY, **more)


def numbers(folder: Path) -> list[int]:
    found: list[int] = StudyResults(folder).frame()["run"].tolist()
    return found


def test_rows_are_there_at_once_and_to_the_last_bit(tmp_path: Path) -> None:
    store = opened(tmp_path)
    for run in (2, 0, 1):
        store.add(row(run))
        assert run in numbers(tmp_path)
    assert StudyResults(tmp_path).frame()["fuel_g"].tolist() == [0.0, 1 / 3, 2 / 3]
    store.close()
    assert StudyResults(tmp_path).frame()["fuel_g"].tolist() == [0.0, 1 / 3, 2 / 3]
    assert not (tmp_path / JOURNAL).exists()


def test_a_line_that_was_cut_off_is_no_run(tmp_path: Path) -> None:
    store = opened(tmp_path)
    store.add(row(0))
    with (tmp_path / JOURNAL).open("ab") as journal:
        journal.write(json.dumps(row(1)).encode()[:20])
    assert numbers(tmp_path) == [0]
    store.close()
    again = opened(tmp_path, resume=True)
    assert list(again.finished[:2]) == [1, 0]
    again.add(row(1))
    again.close()
    assert numbers(tmp_path) == [0, 1]


def test_a_run_in_part_and_journal_is_read_once(tmp_path: Path) -> None:
    """The process died after it had written the part, before it began a new journal."""
    store = opened(tmp_path)
    store.add(row(0))
    before = (tmp_path / JOURNAL).read_bytes()
    store.close()
    (tmp_path / JOURNAL).write_bytes(before)
    assert numbers(tmp_path) == [0]
    again = opened(tmp_path, resume=True)
    again.add(row(1))
    again.close()
    assert [parquet.read_table(file)["run"].to_pylist() for file in part_files(tmp_path)] == [
        [0],
        [1],
    ]


def test_parts_are_made_on_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PART_ROWS", 4)
    store = opened(tmp_path)
    for run in range(9):
        store.add(row(run, error="no" if run == 3 else None))
    assert len(part_files(tmp_path)) == 2
    assert numbers(tmp_path) == list(range(9))
    store.close()
    again = opened(tmp_path, resume=True)
    assert (sum(again.finished), again.failed) == (9, 1)
    again.close()


def test_what_is_not_finite_is_nothing(tmp_path: Path) -> None:
    store = opened(tmp_path)
    store.add(row(0, wall_s=float("inf"), error=None))
    store.close()
    assert StudyResults(tmp_path).frame()["wall_s"].isna().tolist() == [True]


def test_a_folder_is_not_used_twice(tmp_path: Path) -> None:
    store = opened(tmp_path / "new")
    with pytest.raises(InputError, match="--resume goes on"):
        opened(tmp_path / "new")
    with pytest.raises(InputError, match="another process"):
        opened(tmp_path / "new", resume=True)
    store.close()
    opened(tmp_path / "new", resume=True).close()


@pytest.mark.parametrize("what", IDENTITY)
def test_results_of_other_code_or_another_study_are_not_gone_on_with(
    tmp_path: Path, what: str
) -> None:
    opened(tmp_path).close()
    with pytest.raises(InputError, match=f"other {what}"):
        Store(tmp_path, STUDY, {**IDENTITY, what: "other"}, resume=True)


def test_a_damaged_part_is_named(tmp_path: Path) -> None:
    store = opened(tmp_path)
    store.add(row(0))
    store.close()
    part_files(tmp_path)[0].write_bytes(b"PAR1")
    with pytest.raises(InputError, match=r"part-00000\.parquet: damaged"):
        opened(tmp_path, resume=True)


@pytest.mark.parametrize(
    "line",
    [
        b'{"run": 10000, "cycle": "nycc"}',
        b'{"run": -1}',
        b'{"run": 2, "cycle": [1]}',
        b'{"run": 2, "seed": 1e300}',
        b'{"run": 2, "seed": 100000000000000000000}',
    ],
)
def test_a_journal_with_what_is_no_run_is_named(tmp_path: Path, line: bytes) -> None:
    opened(tmp_path).close()
    (tmp_path / JOURNAL).write_bytes(line + b"\n")
    with pytest.raises(InputError, match=f"{JOURNAL}: damaged"):
        opened(tmp_path, resume=True)
    (tmp_path / JOURNAL).unlink()
    opened(tmp_path, resume=True).close()


def test_noise_in_a_journal_is_no_run(tmp_path: Path) -> None:
    opened(tmp_path).close()
    noise = b'\xff\xfe\n{"run": true}\n[1]\nnull\n{"run": 1.5}\n' + b"[" * 100_000 + b"\n"
    (tmp_path / JOURNAL).write_bytes(noise + json.dumps(row(3)).encode() + b"\n")
    assert numbers(tmp_path) == [3]
    store = opened(tmp_path, resume=True)
    assert sum(store.finished) == 1
    store.close()


def test_a_part_of_another_study_is_named(tmp_path: Path) -> None:
    other = Store(tmp_path / "other", STUDY, {**IDENTITY, "runs": "z"})
    other.add(row(0))
    other.close()
    opened(tmp_path / "mine").close()
    (part,) = part_files(tmp_path / "other")
    part.rename(tmp_path / "mine" / PARTS / part.name)
    with pytest.raises(InputError, match=f"{part.name}: is a part of another study"):
        opened(tmp_path / "mine", resume=True)


def test_a_damaged_part_is_named_by_the_report_too(tmp_path: Path) -> None:
    store = opened(tmp_path)
    store.add(row(0))
    store.close()
    part_files(tmp_path)[0].write_bytes(b"PAR1")
    with pytest.raises(InputError, match=r"part-00000\.parquet: damaged"):
        StudyResults(tmp_path).frame()


def test_a_deleted_folder_is_noticed_at_the_next_run(tmp_path: Path) -> None:
    store = opened(tmp_path / "gone")
    store.add(row(0))
    shutil.rmtree(tmp_path / "gone")
    with pytest.raises(FileNotFoundError, match=f"deleted while.*{JOURNAL}"):
        store.add(row(1))
    with pytest.raises(FileNotFoundError):
        store.close()


@pytest.mark.parametrize("line", [b'{"runs": 3', b"null", b"\xff\xff", b"[" * 100_000])
def test_a_session_that_was_cut_off_does_not_matter(tmp_path: Path, line: bytes) -> None:
    store = opened(tmp_path)
    store.add_session(1, 2.0, 3)
    store.close()
    with (tmp_path / SESSIONS).open("ab") as file:
        file.write(line + b"\n")
    found = StudyResults(tmp_path).provenance
    assert (found["workers"], found["elapsed_s"]) == ("3", "2.0")


@pytest.mark.parametrize("text", ["{}", "[", "[" * 100_000, '{"study": 1, "identity": 2}'])
def test_a_broken_study_json_is_named(tmp_path: Path, text: str) -> None:
    opened(tmp_path).close()
    (tmp_path / "study.json").write_text(text)
    with pytest.raises(InputError, match=r"study\.json"):
        StudyResults(tmp_path).frame()
    with pytest.raises(InputError, match=r"study\.json: cannot be read"):
        opened(tmp_path, resume=True)


def test_a_study_without_any_run_has_an_empty_table_and_a_report(tmp_path: Path) -> None:
    opened(tmp_path).close()
    results = StudyResults(tmp_path)
    assert results.frame().empty
    results.write_report()
    assert (tmp_path / "summary.json").exists()


def test_a_folder_without_a_study_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no study"):
        StudyResults(tmp_path).frame()
