"""Output of commands: results, notes and progress."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from qpmpc.cli.inputs import STDOUT
from qpmpc.cli.stdout import to_stderr
from qpmpc.controllers.base import Progress as Report
from qpmpc.files import json_text, write_text
from qpmpc.shown import shown

UNLIMITED_WIDTH = 1000


class _Console(Console):
    """Console that prints text as it is, control characters escaped; `main` gets broken pipes."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print text without markup, or a table."""
        plain = (shown(each) if isinstance(each, str) else each for each in objects)
        super().print(*plain, **{"markup": False, **options})

    def on_broken_pipe(self) -> None:
        """Raise, where rich would exit with code 1."""
        raise BrokenPipeError


def result_console(json_file: Path | None = None) -> Console:
    """Console for results: stdout, but stderr when stdout is for JSON.

    Outside a terminal there is no width to fit into, and no line is broken.
    """
    file = sys.stderr if json_file == STDOUT else sys.stdout
    width = None if file.isatty() else UNLIMITED_WIDTH
    return _Console(file=file, width=width, highlight=False, soft_wrap=not file.isatty())


def write_json(data: Any, json_file: Path | None) -> None:
    """Write JSON to a file or, for ``-``, to stdout."""
    if json_file == STDOUT:
        sys.stdout.write(json_text(data))
    elif json_file is not None:
        write_text(json_file, json_text(data))


class ProgressBar:
    """One bar for several jobs, on stderr, in a terminal only."""

    def __init__(self, progress: Progress, jobs: int) -> None:
        self._progress = progress
        self._jobs = jobs
        self._begun = 0
        self._task = progress.add_task("", total=float(jobs))

    def next_job(self, title: str) -> Report:
        """Start a job; returns the function to call with its progress."""
        done_before = self._begun
        self._begun += 1
        title = shown(title)
        label = f"{title} ({self._begun}/{self._jobs})" if self._jobs > 1 else title
        self._progress.update(self._task, description=label, completed=float(done_before))

        def report(done: int, total: int) -> None:
            self._progress.update(self._task, completed=done_before + done / max(total, 1))

        return report


@contextmanager
def progress_bar(jobs: int) -> Iterator[ProgressBar]:
    """Show a progress bar while the block runs; neither it nor a solver writes to stdout."""
    console = Console(stderr=True)
    with (
        to_stderr(),
        Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        ) as progress,
    ):
        yield ProgressBar(progress, jobs)
