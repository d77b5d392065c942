"""Many independent jobs in processes of this machine or on a Dask cluster.

Memory does not grow with the number of jobs: few are under way at a time, and results are passed
on as they come.
"""

import logging
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from itertools import islice
from multiprocessing.connection import wait as wait_for
from time import perf_counter
from typing import Any, Protocol, TypeVar

from qpmpc.errors import QpmpcError

Job = TypeVar("Job")
Result = TypeVar("Result")

BATCH_S = 0.3  # of work that travels at once: more than the way takes, and soon recorded
BATCH_MAX = 64
AHEAD = 2  # batches under way for each process
DEATHS_MAX = 2  # of processes that had nothing but one job
SMOOTHING = 0.1  # of the mean time of a job
NO_PROCESS = (
    "no process can be started; a script must be a file, and what it does stand below "
    "'if __name__ == \"__main__\":', since each process imports it"
)
THREADS_VARIABLE = "QPMPC_THREADS"
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Lost:
    """A job whose process died, each time it was tried."""

    reason: str


class Workers(Protocol):
    """Processes that take batches of jobs."""

    @property
    def slots(self) -> int:
        """Number of batches that they work on at the same time."""
        ...

    def submit(self, function: Callable[[Any], Result], batch: Any) -> Future[Result]:
        """Start a batch."""
        ...

    def died(self, error: BaseException) -> bool:
        """Whether a batch failed because its process died, and not by an exception of its own."""
        ...

    def close(self) -> None:
        """End what was begun, whatever it does."""
        ...


def processes() -> int:
    """Return the number of processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on Linux
        return os.cpu_count() or 1


class LocalWorkers:
    """Processes of this machine; they end with this one, however it ends.

    Parameters
    ----------
    count : of processes; as many as there are processors if None
    """

    def __init__(self, count: int | None = None) -> None:
        self.slots = count or processes()
        _log.info("%d worker processes", self.slots)
        self._others = set(multiprocessing.active_children())
        self._pool = self._new()
        self._first: Future[None] | None = None  # which needs nothing but a process

    def _new(self) -> ProcessPoolExecutor:
        # spawned, not forked: compiled code may have threads by now
        return ProcessPoolExecutor(
            self.slots, multiprocessing.get_context("spawn"), initializer=_begin_worker
        )

    def submit(self, function: Callable[[Any], Result], batch: Any) -> Future[Result]:
        """See `Workers`."""
        try:
            if self._first is None:
                self._first = self._pool.submit(_nothing)
            return self._pool.submit(function, batch)
        except BrokenProcessPool:
            self.close()
            self._pool = self._new()
            return self._pool.submit(function, batch)

    def died(self, error: BaseException) -> bool:
        """See `Workers`.

        Raises
        ------
        QpmpcError
            If no process can be started at all.
        """
        if not isinstance(error, BrokenProcessPool):
            return False
        if self._first is not None and self._first.exception() is not None:
            self.close()
            self._pool = self._new()
            self._first = self._pool.submit(_nothing)
            if self._first.exception() is not None:
                raise QpmpcError(NO_PROCESS)
        return True

    def close(self) -> None:
        """See `Workers`."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - self._others:
            child.kill()
        self._pool.shutdown(wait=True)


def _nothing() -> None:
    """Do nothing: a process that does it has started."""


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, end with it, use one thread, and say nothing."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare_process()
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def prepare_process() -> None:
    """Use one thread for compiled code; what there is to say is in the rows."""
    os.environ.setdefault(THREADS_VARIABLE, "1")
    logging.getLogger("qpmpc").setLevel(logging.ERROR)


def _end_with(sentinel: int) -> None:
    wait_for([sentinel])
    os._exit(1)


def completed(
    function: Callable[[Sequence[Job]], list[tuple[Result, float]]],
    jobs: Iterable[Job],
    workers: Workers,
) -> Iterator[tuple[Job, Result | Lost]]:
    """Do jobs and yield each with its result, in the order in which they end.

    A process that dies is replaced. Its jobs, and those beside it, are then done alone, so that
    one that kills its process is found: it is given up, and the others go on.

    Parameters
    ----------
    function : of several jobs; returns the result of each, and its time in s. What it raises ends
        everything
    jobs : taken as they are needed
    workers : that do them; the caller closes them
    """
    rest = iter(jobs)
    suspects: deque[Job] = deque()
    deaths = 0  # of the first suspect
    job_s = BATCH_S
    pending: dict[Future[list[tuple[Result, float]]], list[Job]] = {}
    while True:
        while len(pending) < (1 if suspects else AHEAD * workers.slots):
            batch = [suspects[0]] if suspects else _batch(rest, job_s)
            if not batch:
                break
            pending[workers.submit(function, batch)] = batch
        if not pending:
            return
        alone = bool(suspects) and len(pending) == 1 and [suspects[0]] in pending.values()
        for future in wait(pending, return_when=FIRST_COMPLETED).done:
            batch = pending.pop(future)
            error = CancelledError() if future.cancelled() else future.exception()
            if error is None:
                if alone:
                    suspects.popleft()
                    deaths = 0
                for job, (result, seconds) in zip(batch, future.result(), strict=True):
                    job_s += SMOOTHING * (seconds - job_s)
                    yield job, result
            elif not workers.died(error):
                raise error
            elif not alone:
                _log.info("a process died: its %d jobs, and those beside it, alone", len(batch))
                suspects.extend(batch)
            else:
                deaths += 1
                if deaths == DEATHS_MAX:
                    deaths = 0
                    suspects.popleft()
                    yield batch[0], Lost(f"its process died, {DEATHS_MAX} times of {DEATHS_MAX}")


def in_order(
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    progress: Callable[[int, int], None] | None = None,
    count: int | None = None,
) -> list[Result]:
    """Do jobs in processes of this machine and return their results in the order of the jobs.

    Parameters
    ----------
    function : of one job; what it raises ends everything
    progress : called as progress(done, in all)
    count : of processes; as many as there are processors if None

    Raises
    ------
    QpmpcError
        If a job kills its process.
    """
    found: dict[int, Result] = {}
    workers = LocalWorkers(count)
    try:
        for (number, _), result in completed(partial(_each, function), [*enumerate(jobs)], workers):
            if isinstance(result, Lost):
                raise QpmpcError(f"job {number}: {result.reason}")
            found[number] = result
            if progress is not None:
                progress(len(found), len(jobs))
    finally:
        workers.close()
    return [found[number] for number in range(len(jobs))]


def _each(
    function: Callable[[Job], Result], batch: Sequence[tuple[int, Job]]
) -> list[tuple[Result, float]]:
    done = []
    for _, job in batch:
        start = perf_counter()
        result = function(job)
        done.append((result, perf_counter() - start))
    return done


def _batch(jobs: Iterator[Job], job_s: float) -> list[Job]:
    """Take jobs of about `BATCH_S` together."""
    return list(islice(jobs, max(1, min(BATCH_MAX, round(BATCH_S / job_s)))))
