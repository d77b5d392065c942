"""Many jobs in processes: each is done once, whatever dies."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import pytest

from qpmpc.pool import AHEAD, BATCH_MAX, LocalWorkers, Lost, completed

WORKERS = 2


def squares(batch: Sequence[int]) -> list[tuple[int, float]]:
    return [(job * job, 1e-3) for job in batch]


def dying(deadly: int, once: str, batch: Sequence[int]) -> list[tuple[int, float]]:
    """Job `deadly` kills its process; job 5 does so the first time only."""
    for job in batch:
        first = job == 5 and not Path(once).exists()
        if first:
            Path(once).touch()
        if job == deadly or first:
            os.kill(os.getpid(), signal.SIGKILL)
    return squares(batch)


def failing(batch: Sequence[int]) -> list[tuple[int, float]]:
    raise ValueError("wrong from the start")


@pytest.fixture
def workers() -> Iterator[LocalWorkers]:
    made = LocalWorkers(WORKERS)
    yield made
    made.close()


def test_every_job_is_done_once_and_few_are_taken_ahead(workers: LocalWorkers) -> None:
    taken = 0

    def jobs() -> Iterator[int]:
        nonlocal taken
        while taken < 2000:
            taken += 1
            yield taken

    done = []
    for job, result in completed(squares, jobs(), workers):
        assert result == job * job
        done.append(job)
        # what bounds memory: results are taken one by one, and few jobs are under way
        assert taken - len(done) <= (AHEAD * WORKERS + 1) * BATCH_MAX
    assert sorted(done) == list(range(1, 2001))


def test_a_job_that_kills_its_process_is_given_up_and_no_other(
    workers: LocalWorkers, tmp_path: Path
) -> None:
    function = partial(dying, 17, str(tmp_path / "once"))
    found = dict(completed(function, range(40), workers))
    lost = {job for job, result in found.items() if isinstance(result, Lost)}
    assert lost == {17}
    assert {job: r for job, r in found.items() if job != 17} == {
        job: job * job for job in range(40) if job != 17
    }


def test_an_exception_of_the_function_ends_everything(workers: LocalWorkers) -> None:
    with pytest.raises(ValueError, match="wrong from the start"):
        list(completed(failing, range(3), workers))


def test_workers_end_with_their_parent_even_if_it_is_killed(tmp_path: Path) -> None:
    program = tmp_path / "parent.py"
    program.write_text(
        "import multiprocessing, time\n"
        "from qpmpc.pool import LocalWorkers\n"
        "if __name__ == '__main__':\n"
        "    workers = LocalWorkers(1)\n"
        "    workers.submit(len, 'x').result()\n"
        "    print(multiprocessing.active_children()[0].pid, flush=True)\n"
        "    time.sleep(60)\n"
    )
    parent = subprocess.Popen([sys.executable, str(program)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    until = time.monotonic() + 10.0
    while _lives(child) and time.monotonic() < until:
        time.sleep(0.05)
    assert not _lives(child)


def _lives(process: int) -> bool:
    """Whether a process runs; one that ended and was not collected does not."""
    try:
        state = Path(f"/proc/{process}/stat").read_text("utf-8").rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


@pytest.mark.parametrize("how", ["without a guard", "without a file"])
def test_a_script_whose_processes_cannot_start_is_told_why(tmp_path: Path, how: str) -> None:
    """Each process imports the script, which starts processes again, or is not there."""
    script = tmp_path / "script.py"
    script.write_text(
        "from math import sqrt\nfrom qpmpc.pool import in_order\nin_order(sqrt, [1, 4], count=1)\n"
    )
    command = [sys.executable, *([script] if how == "without a guard" else ["-"])]
    done = subprocess.run(
        command, input=script.read_text(), capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert "no process can be started" in done.stderr.splitlines()[-1]
