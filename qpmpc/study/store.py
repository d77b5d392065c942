"""Results of a study on disk: a journal of the latest rows, and Parquet in parts.

A run is finished when its row is in the journal. Every `PART_ROWS` rows, and at the end, the
journal becomes a part. A run that is in both, because the process died between two steps, is read
once.
"""

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from fcntl import LOCK_EX, LOCK_NB, flock
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpmpc.errors import InputError
from qpmpc.files import check_folder, json_text, replace_file, write_bytes, write_text
from qpmpc.study.columns import schema
from qpmpc.study.definition import Study
from qpmpc.study.journal import Journal, Row, finite, rows_in

if TYPE_CHECKING:
    import pyarrow

STUDY, SESSIONS, JOURNAL, LOCK = "study.json", "sessions.jsonl", "journal.jsonl", "lock"
PARTS, TRAJECTORIES = "runs", "trajectories"
PART_ROWS = 2_000
MARK = "qpmpc"  # key of what the results of a part depend on


class Store:
    """The folder of a study that is being run, by this process alone.

    Parameters
    ----------
    folder : is made if it is not there
    study : whose results it holds
    identity : what results depend on, by its name in messages
    resume : go on with what is there

    Attributes
    ----------
    finished : 1 at the number of each run that it has, 0 at the others
    failed : number of those that failed

    Raises
    ------
    InputError
        If the folder cannot be written to, holds a study and `resume` is false, holds another
        study, or is in use.
    """

    def __init__(
        self, folder: Path, study: Study, identity: dict[str, str], resume: bool = False
    ) -> None:
        check_folder(folder, "--out")
        mark = {MARK: json.dumps(identity)}
        self.folder, self._schema = folder, schema(study).with_metadata(mark)
        held = folder / STUDY
        if held.exists():
            _check_same(held, identity, resume)
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = _locked(folder)
        try:
            if held.exists():  # by a process that has ended since
                _check_same(held, identity, resume)
            else:
                data = {"study": study.model_dump(exclude_none=True), "identity": identity}
                write_text(held, json_text(data))
            (folder / PARTS).mkdir(exist_ok=True)
            self.finished = bytearray(study.combinations)
            self.failed = 0
            for number, error in _in_parts(folder, mark):
                self._note(number, error)
            rows = [*rows_in(folder / JOURNAL)]
            table_of(rows, self._schema, folder / JOURNAL)
            if not all(0 <= row["run"] < len(self.finished) for row in rows):
                raise _damaged(folder / JOURNAL)
            self._rows = [row for row in rows if not self.finished[row["run"]]]
            for row in self._rows:
                self._note(row["run"], row.get("error"))
            self._journal = Journal(folder / JOURNAL, self._rows)
        except BaseException:
            if not held.exists():  # nothing was begun: leave nothing
                (folder / LOCK).unlink(missing_ok=True)
                with suppress(OSError):
                    folder.rmdir()
            os.close(self._lock)
            raise

    def add(self, row: Row) -> None:
        """Record a finished run.

        Raises
        ------
        OSError
            If it cannot be written; what was written before stays.
        """
        self._rows.append(row)  # first: if Ctrl-C comes between, `close` still writes it
        try:
            self._journal.add(row)
        except OSError:
            self._rows.pop()
            raise
        self._note(row["run"], row.get("error"))
        if len(self._rows) >= PART_ROWS:
            self._make_part()
            self._journal.close()
            self._journal = Journal(self.folder / JOURNAL, [])

    def add_trajectory(self, run: int, content: bytes) -> None:
        """Write the trajectory of a run: before its row, so that a row has its trajectory."""
        write_bytes(self.folder / TRAJECTORIES / f"run-{run:07d}.parquet", content)

    def close(self) -> None:
        """Make a part of what there is, and let others use the folder."""
        try:
            self._journal.close()
            self._make_part()
            with suppress(FileNotFoundError):
                (self.folder / JOURNAL).unlink()
        finally:
            os.close(self._lock)

    def add_session(self, runs: int, seconds: float, workers: int) -> None:
        """Note how long this process took for its runs."""
        session = {"runs": runs, "elapsed_s": seconds, "workers": workers}
        with (self.folder / SESSIONS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(session) + "\n")

    def _make_part(self) -> None:
        import pyarrow.parquet as parquet

        if not self._rows:
            return
        rows = sorted(map(finite, self._rows), key=lambda row: int(row["run"]))
        numbers = [int(file.stem.partition("-")[2]) for file in part_files(self.folder)]
        name = f"part-{max(numbers, default=-1) + 1:05d}.parquet"
        into = BytesIO()
        parquet.write_table(table_of(rows, self._schema, name), into, compression="zstd")
        replace_file(self.folder / PARTS / name, into.getvalue(), durable=True)
        self._rows = []

    def _note(self, number: int, error: str | None) -> None:
        self.failed += error is not None and not self.finished[number]
        self.finished[number] = 1


def part_files(folder: Path) -> list[Path]:
    """Return the parts of a study's folder, in the order in which they were written."""
    return sorted((folder / PARTS).glob("part-*.parquet"))


def table_of(rows: list[Row], columns: "pyarrow.Schema", file: Path | str) -> "pyarrow.Table":
    """Return rows as a table.

    Raises
    ------
    InputError
        If they are not of these columns: somebody else wrote into the file.
    """
    import pyarrow as pa

    try:
        return pa.Table.from_pylist(rows, columns)
    except (pa.ArrowException, OverflowError) as error:
        raise _damaged(file) from error


def part_table(file: Path, **how: Any) -> "pyarrow.Table":
    """Return a part, read as `pyarrow.parquet.read_table` does.

    Raises
    ------
    InputError
        If it is damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as parquet

    try:
        return parquet.read_table(file, **how)
    except (pa.ArrowException, OSError) as error:
        raise _damaged(file) from error


def _in_parts(folder: Path, mark: dict[str, str]) -> Iterator[tuple[int, str | None]]:
    """Yield number and error of each run in the parts."""
    for file in part_files(folder):
        table = part_table(file, columns=["run", "error"])
        if (table.schema.metadata or {}).get(MARK.encode()) != mark[MARK].encode():
            raise InputError(f"{file}: is a part of another study: move it away")
        yield from zip(table["run"].to_pylist(), table["error"].to_pylist(), strict=True)


def _damaged(file: Path | str) -> InputError:
    return InputError(f"{file}: damaged: delete it, and --resume repeats its runs")


def _check_same(file: Path, identity: dict[str, str], resume: bool) -> None:
    if not resume:
        raise InputError(
            f"--out {file.parent}: holds a study: --resume goes on with it, or give another folder"
        )
    try:
        held = json.loads(file.read_text("utf-8"))["identity"]
        differ = [what for what, now in identity.items() if held.get(what) != now]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{file}: cannot be read as a study's") from error
    if differ:
        then = f" (then {held['versions']}; now {identity['versions']})"
        raise InputError(
            f"--resume: {file.parent} was made with other {' and '.join(differ)}"
            f"{then if 'versions' in differ else ''}: give another folder"
        )


def _locked(folder: Path) -> int:
    handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        flock(handle, LOCK_EX | LOCK_NB)
    except OSError:
        os.close(handle)
        raise InputError(f"--out {folder}: another process is running this study") from None
    return handle
