"""Run a study: its runs in many processes, their rows on disk."""

import os
from collections.abc import Callable, Mapping
from functools import partial
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import Any

from qpmpc.errors import InputError
from qpmpc.pool import LocalWorkers, Lost, Workers, completed
from qpmpc.remarks import say_once
from qpmpc.study.cluster import ClusterWorkers
from qpmpc.study.definition import Study
from qpmpc.study.identity import code_hash, versions
from qpmpc.study.inputs import Inputs, read_inputs
from qpmpc.study.load import as_study, load_study
from qpmpc.study.results import StudyResults, remarks_on
from qpmpc.study.run import lost_row, run_batch
from qpmpc.study.store import Store

NEEDED = ("pyarrow", "pandas")
FOLDER = Path("results")
WORKERS_MAX = 1024

StudyLike = str | os.PathLike[str] | Mapping[str, Any] | Study
Progress = Callable[[int, int, int], None]


def sweep(
    study: StudyLike,
    out: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> StudyResults:
    """Make all runs of a study and keep their results in a folder.

    Parameters
    ----------
    study : a shipped name, a TOML file, or a mapping with the keys of `Study`
    out : folder of the results; ``results/NAME`` if None
    resume : go on with what the folder has; no run that it has is repeated
    workers : processes of this machine; as many as there are processors if None
    scheduler : address of a Dask scheduler, whose workers are used instead
    progress : called as progress(runs done, runs in all, runs failed)

    Raises
    ------
    InputError
        If the study, a name or value in it, the folder or the scheduler cannot be used; before any
        run.
    QpmpcError
        If a worker has other code, or the scheduler is gone; what is finished is kept.
    OSError
        If results cannot be written; what is finished is kept.
    """
    for package in NEEDED:
        if find_spec(package) is None:
            raise InputError(f"studies need {package}: pip install 'qpmpc-iptm[sweep]'")
    if workers is not None and scheduler is not None:
        raise InputError("workers are those of the scheduler: give one of the two")
    if workers is not None and not 1 <= workers <= WORKERS_MAX:
        raise InputError(f"workers must be 1 to {WORKERS_MAX} (given: {workers})")
    chosen = _study(study)
    inputs = read_inputs(chosen)
    for remark in remarks_on(chosen):
        say_once(remark)
    folder = FOLDER / chosen.name if out is None else Path(out)
    pool: Workers = LocalWorkers(workers) if scheduler is None else ClusterWorkers(scheduler)
    try:
        store = Store(folder, chosen, identity_of(chosen, inputs), resume)
        try:
            _run_all(chosen, inputs, store, pool, progress)
        finally:
            store.close()
    finally:
        pool.close()
    return StudyResults(folder)


def _study(study: StudyLike) -> Study:
    if isinstance(study, Study):
        return study
    return as_study(study) if isinstance(study, Mapping) else load_study(study)


def identity_of(study: Study, inputs: Inputs) -> dict[str, str]:
    """Return what the results of a study depend on."""
    return {
        "runs": _hash(study.model_dump_json()),
        "input files": inputs.content_hash(),
        "code": code_hash(),
        "versions": versions(),
    }


def _hash(text: str) -> str:
    return sha256(text.encode()).hexdigest()[:32]


def _run_all(
    study: Study,
    inputs: Inputs,
    store: Store,
    workers: Workers,
    progress: Progress | None,
) -> None:
    total, failed = study.count, store.failed
    done = sum(store.finished)
    if progress is not None:
        progress(done, total, failed)
    if done == total:
        return
    function = partial(run_batch, code_hash(), inputs, study.trajectories)
    jobs = (each for each in study.runs() if not store.finished[each.run])
    begun, before = perf_counter(), done
    for job, result in completed(function, jobs, workers):
        if isinstance(result, Lost):
            row = lost_row(job, result.reason)
        else:
            row, trajectory = result
            if trajectory is not None:
                store.add_trajectory(job.run, trajectory)
        store.add(row)
        done += 1
        failed += row.get("error") is not None
        if progress is not None:
            progress(done, total, failed)
    store.add_session(done - before, perf_counter() - begun, workers.slots)
