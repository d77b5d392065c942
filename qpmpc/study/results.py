"""Results of a study, read from its folder, finished or not."""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpmpc.errors import InputError
from qpmpc.report.provenance import provenance
from qpmpc.report.study.summary import study_summary
from qpmpc.report.study.write import write_study
from qpmpc.results import OPTIMUM, REFERENCE, Run
from qpmpc.settings import validated
from qpmpc.study.columns import SETTING, schema
from qpmpc.study.definition import OF_RUN, Parameters, Study
from qpmpc.study.inputs import Inputs, read_inputs
from qpmpc.study.journal import rows_in
from qpmpc.study.run import rerun
from qpmpc.study.store import JOURNAL, SESSIONS, STUDY, part_files, part_table, table_of

if TYPE_CHECKING:
    from pandas import DataFrame, Series


class StudyResults:
    """The folder of a study.

    Parameters
    ----------
    folder : as `sweep` left it

    Raises
    ------
    InputError
        If it holds no study.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)

    @cached_property
    def study(self) -> Study:
        """The study, as it was run."""
        file = self.folder / STUDY
        try:
            data = json.loads(file.read_text("utf-8"))["study"]
        except FileNotFoundError:
            raise InputError(f"{self.folder}: holds no study ({STUDY})") from None
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            raise InputError(f"{file}: cannot be read as a study's") from None
        return validated(Study, data, os.fspath(file))

    @property
    def name(self) -> str:
        """Name of the study."""
        return self.study.name

    @property
    def description(self) -> str:
        """What it asks."""
        return " ".join(self.study.description.split())

    @property
    def seed(self) -> int:
        """Seed of its samples."""
        return self.study.seed

    @cached_property
    def runs(self) -> int:
        """Number of runs planned."""
        return self.study.count

    @property
    def text(self) -> str:
        """The study as JSON."""
        return self.study.model_dump_json(indent=2, exclude_none=True, exclude_defaults=True)

    @property
    def varied(self) -> list[str]:
        """Columns with more than one value."""
        return [key if key in OF_RUN else SETTING + key for key in self.study.varied]

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions and machine of this process, and the time of the whole; rows have their own."""
        elapsed_s, workers = [], []
        for line in self._sessions.splitlines():
            with suppress(ValueError, KeyError, TypeError, RecursionError):  # a line cut off
                session = json.loads(line)
                elapsed_s.append(float(session["elapsed_s"]))
                workers.append(str(session["workers"]))
        if not workers:
            return provenance()
        return {
            **provenance(),
            "workers": ", ".join(dict.fromkeys(workers)),
            "elapsed_s": f"{sum(elapsed_s):.1f}",
        }

    @property
    def _sessions(self) -> str:
        try:
            return (self.folder / SESSIONS).read_text("utf-8", errors="replace")
        except OSError:
            return ""

    def rerun(self, row: Mapping[str, Any]) -> Run:
        """Drive the run of a row again.

        Raises
        ------
        Whatever makes the run impossible.
        """
        return rerun(parameters_of(row), self._inputs)

    @cached_property
    def _inputs(self) -> Inputs:
        return read_inputs(self.study)

    @property
    def remarks(self) -> list[str]:
        """What a reader should know about the study, one line each."""
        return remarks_on(self.study)

    def summary(self) -> dict[str, Any]:
        """Return the figures of the study as plain data; see `study_summary`."""
        return study_summary(self.frame(), self)

    def write_report(
        self,
        folder: str | os.PathLike[str] | None = None,
        summary: dict[str, Any] | None = None,
    ) -> list[str]:
        """Write report.html, pictures, summary.json and summary.md; returns remarks.

        Parameters
        ----------
        folder : the study's own if None
        summary : as `summary` returned it, where the caller has it
        """
        into = self.folder if folder is None else Path(folder)
        return write_study(self.frame(), self, into, self.rerun, summary)

    def frame(self) -> "DataFrame":
        """Return all rows, sorted by `run`, with two columns more.

        fuel_above_dp_percent = 100 (m / m_dp - 1),   saving_vs_rule_percent = 100 (1 - m / m_rule)

        with m the SOC-balanced fuel, at the price of SOC that dp found where it drove the trip,
        and the others' of the same `trip_hash`: of several runs of dp the least, of several of the
        rules the first. NaN where one of the two is missing or not comparable.
        """
        import pandas as pd
        import pyarrow as pa

        form = schema(self.study)
        # the journal first: its rows move into a part, not back
        latest = table_of([*rows_in(self.folder / JOURNAL)], form, self.folder / JOURNAL)
        tables = [part_table(file, schema=form) for file in part_files(self.folder)]
        table = pa.concat_tables([*tables, latest])
        frame: DataFrame = table.to_pandas()
        for key in self.study.settings:
            if self.study.kind_of(key) is int:  # which pandas makes floats of, beside nothing
                frame[SETTING + key] = pd.array(table[SETTING + key].to_pylist(), dtype="Int64")
        frame = frame.drop_duplicates("run").sort_values("run", ignore_index=True)
        balanced = _at_dp_price(frame).where(frame["comparable"].eq(True))
        by_trip = pd.DataFrame({"trip": frame["trip_hash"], "m": balanced})
        of_dp = by_trip[frame["controller"] == OPTIMUM].groupby("trip")["m"]
        of_rules = by_trip[frame["controller"] == REFERENCE].groupby("trip")["m"]
        optimum, rule = (
            frame["trip_hash"].map(m).astype(float) for m in (of_dp.min(), of_rules.first())
        )
        frame["fuel_above_dp_percent"] = 100.0 * (balanced / optimum - 1.0)
        frame["saving_vs_rule_percent"] = 100.0 * (1.0 - balanced / rule)
        return frame


def _at_dp_price(frame: "DataFrame") -> "Series[float]":
    """SOC-balanced fuel at the price of SOC that dp found on the same trip, if it did."""
    of_dp = frame[frame["controller"] == OPTIMUM].groupby("trip_hash")["soc_price_g"].first()
    price = frame["trip_hash"].map(of_dp).astype(float)
    missing = frame["soc_end_target"] - frame["soc_end"]
    missing = missing.mask(frame["soc_end_at_least"].eq(True), missing.clip(lower=0.0))
    at_dp = frame["fuel_g"] + price * missing
    return at_dp.fillna(frame["fuel_soc_balanced_g"])


def remarks_on(study: Study) -> list[str]:
    """Return what a user should know about a study, one line each."""
    idle = study.idle
    return [f"no effect on any controller of the study: {', '.join(idle)}"] if idle else []


def parameters_of(row: Mapping[str, Any]) -> Parameters:
    """Return the parameters of a run from its row."""
    import pandas as pd

    settings = {
        name.removeprefix(SETTING): value
        for name, value in row.items()
        if name.startswith(SETTING) and not pd.isna(value)
    }
    return Parameters(
        run=int(row["run"]),
        cycle=row["cycle"],
        vehicle=row["vehicle"],
        controller=row["controller"],
        forecast=row["forecast"],
        faults=row["faults"] if isinstance(row["faults"], str) else None,
        seed=int(row["seed"]),
        settings=settings,
    )
