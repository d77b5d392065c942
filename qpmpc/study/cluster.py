"""The processes of an existing Dask cluster."""

import logging
import re
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.util import find_spec
from time import monotonic
from typing import Any, TypeVar

from qpmpc.errors import InputError, QpmpcError
from qpmpc.problems import shown_value

Result = TypeVar("Result")

REACH_S = 10.0  # in which a scheduler answers
COUNT_S = 2.0  # between two counts of the workers
WORKERS_S = 30.0  # in which its first worker is there
PORT_MAX = 65_535
_log = logging.getLogger(__name__)
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://\S+:([0-9]{1,5})/?", re.ASCII)


class ClusterWorkers:
    """Workers of a scheduler; those that come later take part too.

    Parameters
    ----------
    address : of the scheduler, such as ``tcp://192.0.2.7:8786``

    Raises
    ------
    InputError
        If dask is not installed, the address is none, no scheduler answers, or it has no worker.
    """

    def __init__(self, address: str) -> None:
        if find_spec("distributed") is None:
            raise InputError("a scheduler needs dask: pip install 'qpmpc-iptm[sweep]'")
        distributed: Any = import_module("distributed")
        self._address = address
        _check_address(address)
        _quiet()
        try:
            self._client = distributed.Client(address, timeout=REACH_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise InputError(f"scheduler {address}: cannot be reached: {reason}") from None
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            self._client.close()
            raise InputError(
                f"scheduler {address}: no worker in {WORKERS_S:g} s; start some with: "
                f"dask worker {address}"
            ) from None
        self._executor = self._client.get_executor(pure=False)
        self._killed = distributed.scheduler.KilledWorker
        self._closed = distributed.comm.core.CommClosedError
        self._slots, self._counted_until = 1, 0.0
        _log.info("workers of the scheduler %s", address)

    @property
    def slots(self) -> int:
        """See `Workers`."""
        if monotonic() > self._counted_until:
            with self._connected():
                self._slots = max(1, sum(self._client.nthreads().values()))
            self._counted_until = monotonic() + COUNT_S
        return self._slots

    def submit(self, function: Callable[[Any], Result], batch: Any) -> Future[Result]:
        """See `Workers`."""
        with self._connected():
            future: Future[Result] = self._executor.submit(function, batch)
        return future

    def died(self, error: BaseException) -> bool:
        """See `Workers`.

        Raises
        ------
        QpmpcError
            If the scheduler is gone.
        """
        if isinstance(error, CancelledError | self._closed):
            raise self._gone() from None
        return isinstance(error, self._killed)

    @contextmanager
    def _connected(self) -> Iterator[None]:
        try:
            yield
        except (CancelledError, OSError, TimeoutError, RuntimeError):
            raise self._gone() from None

    def _gone(self) -> QpmpcError:
        return QpmpcError(f"scheduler {self._address} is gone; --resume goes on later")

    def close(self) -> None:
        """See `Workers`."""
        with suppress(Exception):  # whatever state the connection is in
            self._executor.shutdown(wait=False)
            self._client.close(timeout=2)


def _check_address(address: str) -> None:
    """Refuse what a client would take long to fail with, and not in one line."""
    found = _ADDRESS.fullmatch(address)
    if found is None or int(found[2]) > PORT_MAX:
        given = shown_value(address)
        raise InputError(f"scheduler {given}: is no address, such as tcp://192.0.2.7:8786")
    security: Any = import_module("distributed").Security()
    if found[1] in ("tls", "wss") and not security.get_connection_args("client")["ssl_context"]:
        raise InputError(f"scheduler {address}: dask's configuration has no certificates for TLS")


def _quiet() -> None:
    """Keep the client's log off the terminal: what matters is raised."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
