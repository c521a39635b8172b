"""Processes of many computers that execute calls: the workers of a Dask scheduler."""

from __future__ import annotations

import asyncio
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from importlib import import_module
from importlib.metadata import version
from threading import Lock
from typing import Any
from uuid import uuid4

import cloudpickle

from omnidrive.errors import InvalidInput, MissingExtra, WorkerLost, one_line
from omnidrive.execution.versions import VERSIONS
from omnidrive.execution.worker_pool import Call, Ended, Lost

_ANSWER_TIME = 10.0  # s in which a scheduler must answer
_QUEUED = 2  # calls per worker, so that none waits for the network

_set_up: list[str] = []  # hash of the setup of this process, a worker
_one_at_a_time = Lock()  # calls share the caches of their process


class ClusterPool:
    """Workers of a Dask scheduler that execute calls, in a ``with`` statement.

    A call whose worker is lost is executed by another one. Workers may come and go.
    """

    def __init__(self, address: str, setup: Callable[[], None]) -> None:
        """Connect to a scheduler.

        Args:
            address: Its address, such as tcp://192.168.1.5:8786.
            setup: Picklable function that every process executes first.

        Raises:
            MissingExtra: The package distributed is not installed.
            InvalidInput: No scheduler answers in 10 s.
        """
        try:
            self._dask = import_module("distributed")
        except ModuleNotFoundError:
            raise MissingExtra(
                "a scheduler needs Dask, which is not installed: pip install dask distributed"
            ) from None
        self._address = one_line(address, 200)
        self._setup = cloudpickle.dumps(setup)
        self._calls: dict[Any, Call] = {}
        try:
            with ThreadPoolExecutor(1) as threads:  # this one may have an event loop, as in Jupyter
                threads.submit(asyncio.run, _ask(self._dask, address)).result()
            self._client = self._dask.Client(
                address, timeout=_ANSWER_TIME, set_as_default=False, name="omnidrive"
            )
        except (OSError, ValueError, TypeError) as error:
            reason = one_line(str(error), 120) or "it accepts connections, but does not answer"
            raise InvalidInput(
                f"no Dask scheduler answers at {self._address} in {_ANSWER_TIME:g} s ({reason}); "
                "start one with: dask scheduler"
            ) from None

    def __enter__(self) -> ClusterPool:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.cancel(list(self._calls), force=True)
        self._client.close()

    @property
    def size(self) -> int:
        """Present number of workers."""
        return len(self._client.scheduler_info(n_workers=-1)["workers"])

    @property
    def free(self) -> int:
        """Number of calls that may be submitted now."""
        return max(_QUEUED * self.size, 1) - self.unfinished

    @property
    def unfinished(self) -> int:
        """Number of calls that have not ended."""
        return len(self._calls)

    def submit(self, call: Call, *, first: bool = False) -> None:
        """Queue a call, before the others if ``first``."""
        function = cloudpickle.dumps(call.function)
        future = self._client.submit(
            _execute,
            self._setup,
            function,
            _versions(),
            key=f"omnidrive-{uuid4().hex}",
            priority=int(first),
            pure=False,
        )
        self._calls[future] = call

    def wait(self, timeout: float | None = None) -> list[Ended]:
        """Wait until at least one call ends, and return those that have ended.

        Args:
            timeout: Return an empty list after this wall time, s. None: do not.

        Raises:
            WorkerLost: The scheduler is lost.
            Exception: That of a call.
        """
        try:
            with self._client.as_current():
                done = self._dask.wait(
                    list(self._calls), timeout=timeout, return_when="FIRST_COMPLETED"
                ).done
        except (TimeoutError, self._dask.TimeoutError):
            return []
        except self._dask.client.FuturesCancelledError:
            done = [future for future in self._calls if future.cancelled()]
        return [self._ended(future) for future in done]

    def _ended(self, future: Any) -> Ended:
        """Return the call of a future that is done."""
        call = self._calls.pop(future)
        if future.cancelled():
            raise WorkerLost(f"the scheduler at {self._address} was lost; finished runs are kept")
        error = future.exception()
        if isinstance(error, self._dask.scheduler.KilledWorker):
            return Ended(call, Lost.KILLED)
        if error is not None:
            raise error
        return Ended(call, pickle.loads(future.result()))


async def _ask(dask: Any, address: str) -> None:
    """Ask for the identity of a scheduler; a client waits for ever if a program does not answer.

    Raises:
        OSError: Nothing answers in time, or it is no scheduler.
        ValueError: The address is invalid.
    """
    options = dask.Security().get_connection_args("client")

    async def identity() -> Any:
        """Return what answers."""
        comm = await dask.core.connect(address, timeout=_ANSWER_TIME, **options)
        try:
            return await dask.core.send_recv(comm, op="identity", reply=True)
        finally:
            comm.abort()

    try:
        found = await asyncio.wait_for(identity(), _ANSWER_TIME)
    except MemoryError:  # the length of a message, read from one of another protocol
        found = None
    if not isinstance(found, dict) or found.get("type") != "Scheduler":
        raise OSError("what answers is no scheduler")


def _versions() -> dict[str, str]:
    return {name: version(name) for name in VERSIONS}


def _execute(setup: bytes, function: bytes, versions: dict[str, str]) -> bytes:
    """Execute a call in a worker, after the setup of its process.

    Raises:
        InvalidInput: The worker has other versions, with which results would differ.
    """
    others = [f"{name} {own}" for name, own in _versions().items() if own != versions.get(name)]
    if others:
        raise InvalidInput(
            f"a worker of the scheduler has other versions: {', '.join(others)}; install the same "
            f"ones: {', '.join(f'{name} {each}' for name, each in versions.items())}"
        )
    with _one_at_a_time:
        digest = sha256(setup).hexdigest()
        if _set_up != [digest]:
            pickle.loads(setup)()
            _set_up[:] = [digest]
        result: bytes = cloudpickle.dumps(pickle.loads(function)())
    return result
