"""Files of a study and of a comparison of two."""

import re
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpmpc.files import json_text, write_bytes, write_text
from qpmpc.report.study.figures import Study
from qpmpc.report.study.markdown import summary_markdown
from qpmpc.report.study.pairs import compare_studies
from qpmpc.report.study.pairs_tables import comparison_markdown
from qpmpc.report.study.summary import study_summary
from qpmpc.report.study.worst import Rerun
from qpmpc.report.write import PLOT_EXTRA

if TYPE_CHECKING:
    from pandas import DataFrame

LONGEST_NAME = 100


def write_study(
    frame: "DataFrame",
    study: Study,
    folder: Path,
    rerun: Rerun | None = None,
    summary: dict[str, Any] | None = None,
) -> list[str]:
    """Write summary.json, summary.md, the pictures and report.html; returns remarks.

    Parameters
    ----------
    frame : one row per run
    rerun : drives the run of a row again, for the trajectories of the worst; None: without them
    summary : of `study_summary`, where the caller has it
    """
    summary = study_summary(frame, study) if summary is None else summary
    write_text(folder / "summary.json", json_text(summary))
    write_text(folder / "summary.md", summary_markdown(summary))

    def draw() -> tuple[str, dict[str, bytes], list[str]]:
        from qpmpc.report.study.report import study_page, study_pictures

        drawn = study_pictures(frame, summary, rerun)
        return study_page(frame, study, summary, drawn), drawn.pictures, drawn.remarks

    return _write_page(folder, "report", "summary", draw)


def write_study_comparison(
    frame_a: "DataFrame", study_a: Study, frame_b: "DataFrame", study_b: Study, folder: Path
) -> list[str]:
    """Write comparison.json, comparison.md, the pictures and comparison.html; returns remarks."""
    comparison = compare_studies(frame_a, study_a, frame_b, study_b)
    write_text(folder / "comparison.json", json_text(comparison))
    write_text(folder / "comparison.md", comparison_markdown(comparison))

    def draw() -> tuple[str, dict[str, bytes], list[str]]:
        from qpmpc.report.study.pairs_page import comparison_page, comparison_pictures

        pictures = comparison_pictures(comparison)
        return comparison_page(comparison, pictures), pictures, []

    return _write_page(folder, "comparison", "comparison", draw)


def _write_page(
    folder: Path,
    name: str,
    data: str,
    draw: Callable[[], tuple[str, Mapping[str, bytes], list[str]]],
) -> list[str]:
    if find_spec("matplotlib") is None:
        return [
            f"{folder}: {data}.json and {data}.md written; no pictures and no {name}.html: "
            f"matplotlib is not installed ({PLOT_EXTRA})"
        ]
    html, pictures, remarks = draw()
    for picture, content in pictures.items():
        write_bytes(folder / f"{_file_name(picture)}.png", content)
    write_text(folder / f"{name}.html", html)
    page = folder / f"{name}.html"
    return [f"{page} written, with its pictures, {data}.json and {data}.md", *remarks]


def _file_name(name: str) -> str:
    """Return a name of a picture as one part of a path, whatever the column was called."""
    return re.sub(r"[^A-Za-z0-9._-]", "_", name)[:LONGEST_NAME]
