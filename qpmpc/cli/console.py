"""Output of commands: results, notes and progress."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

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


class _Pace(ProgressColumn):
    """Runs per second, failures and time left, from the runs that were made in this session."""

    def render(self, task: Task) -> Text:
        """Return the text of a task whose field `begun` is the number that was there already."""
        made = task.completed - task.fields["begun"]
        seconds = task.elapsed or 0.0
        failed = task.fields["failed"]
        parts = [f"{failed} failed"] if failed else []
        if made and seconds:
            left = (task.remaining or 0.0) * seconds / made
            parts = [
                f"{made / seconds:.3g} runs/s",
                *parts,
                f"{timedelta(seconds=round(left))} left",
            ]
        return Text(", ".join(parts))


@contextmanager
def study_progress() -> Iterator[Callable[[int, int, int], None]]:
    """Show the progress of a study while the block runs: called with runs done, all and failed."""
    console = Console(stderr=True)
    with (
        to_stderr(),
        Progress(
            BarColumn(),
            MofNCompleteColumn(),
            _Pace(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        ) as bar,
    ):
        task = bar.add_task("", total=None, begun=0, failed=0)

        def report(done: int, total: int, failed: int) -> None:
            if bar.tasks[0].total is None:
                bar.update(task, begun=done)
            bar.update(task, completed=done, total=total, failed=failed)

        yield report
