"""Execution of many items, such as the runs of a study, in blocks on several processes."""

from __future__ import annotations

import logging
import logging.handlers
from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import current_process
from queue import SimpleQueue
from time import perf_counter, sleep
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

from omnidrive.errors import InvalidInput
from omnidrive.execution.cluster import ClusterPool
from omnidrive.execution.heartbeat import Heartbeat
from omnidrive.execution.worker_pool import Call, Ended, Lost, WorkerPool

Item = TypeVar("Item")
Taken_co = TypeVar("Taken_co", covariant=True)
Output = TypeVar("Output")

ATTEMPTS = 3
"""Number of times that an item is computed whose process is killed."""

_BLOCK_TIME = 1.0  # s of work of a block
_GROWTH = 4  # largest ratio of the sizes of two blocks in succession
_IDLE = 0.2  # s between requests to a source that has no items at present

_log = logging.getLogger("omnidrive")


@runtime_checkable
class Source(Protocol[Taken_co]):
    """Items to be computed."""

    def take(self, count: int) -> Sequence[Taken_co] | None:
        """Return up to ``count`` items; empty: none at present; None: none is left."""
        ...


class ListSource(Generic[Item]):
    """The items of a list, in blocks that become smaller at the end."""

    def __init__(self, items: Sequence[Item], processes: int) -> None:
        self._left = deque(items)
        self._processes = processes

    def take(self, count: int) -> list[Item] | None:
        """Return up to ``count`` items; None: none is left."""
        fair = -(-len(self._left) // (2 * self._processes))
        size = min(count, max(fair, 1), len(self._left))
        return [self._left.popleft() for _ in range(size)] or None


@dataclass(frozen=True, slots=True)
class Work(Generic[Item, Output]):
    """What the engine computes.

    Attributes:
        compute: Picklable function that returns the outputs of a block of items.
        lost: Output of an item whose process was lost.
        name: Name of an item for messages.
        largest: Largest number of items of a block.
    """

    compute: Callable[[Sequence[Item]], list[Output]]
    lost: Callable[[Item, Lost], Output]
    name: Callable[[Item], str]
    largest: int = 100_000


@runtime_checkable
class Pool(Protocol):
    """Processes that execute calls."""

    @property
    def free(self) -> int:
        """Number of calls that would start at once."""
        ...

    @property
    def unfinished(self) -> int:
        """Number of calls that have not ended."""
        ...

    def submit(self, call: Call, *, first: bool = False) -> None:
        """Queue a call, at the beginning of the queue if ``first``."""
        ...

    def wait(self, timeout: float | None = None) -> list[Ended]:
        """Wait until at least one call ends, at most ``timeout`` s; return those that ended."""
        ...


class Done(NamedTuple):
    """A block that was computed in another process."""

    outputs: list[Any]
    seconds: float
    """Time of the computation, s."""
    records: list[logging.LogRecord]
    """What was logged meanwhile."""


def execute_blocks(
    source: Source[Item],
    work: Work[Item, Output],
    processes: int,
    *,
    time_limit: float | None = None,
    in_process: bool = False,
    scheduler: str | None = None,
) -> Generator[list[Output], None, None]:
    """Yield the outputs of each block when it is computed.

    The order depends on ``processes``, the outputs do not. A block has about one second of work. If
    its process is killed, the block is computed again in two halves, so that the item that is to
    blame is found; an item whose process is killed three times has the output ``work.lost``.

    Args:
        source: The items.
        work: What is computed.
        processes: Number of worker processes.
        time_limit: Largest wall time of a block in a worker process, s. None: no limit.
        in_process: Whether to compute in this process.
        scheduler: Address of a Dask scheduler, whose workers compute. None: processes of this
            computer.

    Raises:
        WorkerLost: Worker processes end while they start, or the scheduler is lost.
        InvalidInput: The scheduler does not answer, or needs processes and limits of this computer.
        MissingExtra: The scheduler needs an extra that is not installed.
        Exception: That of ``work.compute``.
    """
    if scheduler is not None:
        if in_process or time_limit is not None:
            raise InvalidInput(
                "a scheduler cannot be used with a time limit, or with a plant or controller that "
                "only this process has; omit --run-timeout or --scheduler"
            )
        with ClusterPool(scheduler, partial(start_worker, work.compute)) as cluster:
            yield from execute_on(cluster, source, work)
        return
    if in_process:
        yield from _in_this_process(source, work)
        return
    with WorkerPool(processes, partial(start_worker, work.compute), time_limit=time_limit) as pool:
        yield from execute_on(pool, source, work)


def must_be_in_process() -> bool:
    """Return whether this process, such as one of a pool, may not start processes."""
    return bool(current_process().daemon)


def _in_this_process(
    source: Source[Item], work: Work[Item, Output]
) -> Generator[list[Output], None, None]:
    """Compute all items in this process."""
    size = _BlockSize(work.largest)
    with Heartbeat() as heartbeat:
        while (items := source.take(size.count)) is not None:
            if not items:
                sleep(_IDLE)
                continue
            name = _block_name(work, items)
            heartbeat.begin(name)
            began = perf_counter()
            outputs = work.compute(items)
            size.update(len(items), perf_counter() - began)
            heartbeat.end(name)
            yield outputs


def execute_on(
    pool: Pool, source: Source[Item], work: Work[Item, Output]
) -> Generator[list[Output], None, None]:
    """Yield the outputs of each block when a pool has computed it; see :func:`execute_blocks`."""
    size = _BlockSize(work.largest)
    blocks: dict[int, _Block] = {}
    logged: set[tuple[str, str]] = set()
    is_done = False
    while not is_done or blocks:
        while not is_done and pool.free > 0:
            items = source.take(size.count)
            is_done = items is None
            if not items:
                break
            _submit(pool, blocks, work, _Block(list(items)))
        if not blocks:
            if not is_done:
                sleep(_IDLE)
            continue
        for call, result in pool.wait(None if is_done or pool.free == 0 else _IDLE):
            block = blocks.pop(id(call))
            if isinstance(result, Lost):
                halves = block.retries(result)
                for half in reversed(halves):
                    _submit(pool, blocks, work, half, first=True)
                if not halves:
                    yield [work.lost(block.items[0], result)]
                continue
            size.update(len(block.items), result.seconds)
            log_new(result.records, logged)
            yield result.outputs


@dataclass(slots=True)
class _Block(Generic[Item]):
    """Items that are computed together."""

    items: list[Item]
    attempts: int = 0
    """Number of times that the process of a block of this one item was lost."""
    call: Call | None = field(default=None, repr=False)

    def retries(self, lost: Lost) -> list[_Block[Item]]:
        """Return the blocks to compute after a loss; none: the item has had its attempts."""
        count = len(self.items)
        if count > 1:
            _log.warning("a worker process was killed; its %d items are computed again", count)
            return [_Block(self.items[: count // 2]), _Block(self.items[count // 2 :])]
        if lost is Lost.TIMED_OUT or self.attempts + 1 >= ATTEMPTS:
            return []
        assert self.call is not None
        _log.warning("the process of %s was killed; starting it again", self.call.name)
        return [_Block(self.items, self.attempts + 1)]


def _submit(
    pool: Pool, blocks: dict[int, _Block], work: Work, block: _Block, *, first: bool = False
) -> None:
    """Queue a block."""
    call = Call(_block_name(work, block.items), partial(_computed, block.items))
    block.call = call
    blocks[id(call)] = block
    pool.submit(call, first=first)


def _block_name(work: Work, items: Sequence[Any]) -> str:
    """Return the name of a block for messages."""
    more = f" and {len(items) - 1} more" if len(items) > 1 else ""
    return work.name(items[0]) + more


@dataclass(slots=True)
class _BlockSize:
    """Number of items of the next block, from the times of the last ones."""

    largest: int
    count: int = 1
    _seconds: float = 0.0
    """Time per item, s; 0: unknown."""

    def update(self, count: int, seconds: float) -> None:
        """Consider the time of a block; the first ones compile kernels, so that recent ones count.

        Args:
            count: Number of items of the block.
            seconds: Its time, s.
        """
        each = seconds / count
        self._seconds = each if self._seconds == 0.0 else 0.5 * (self._seconds + each)
        wanted = int(_BLOCK_TIME / max(self._seconds, 1e-9))
        self.count = max(1, min(wanted, _GROWTH * self.count, self.largest))


def log_new(records: Sequence[logging.LogRecord], logged: set[tuple[str, str]]) -> None:
    """Log what worker processes logged, once; ``logged``: loggers and messages so far."""
    for record in records:
        message = record.name, record.getMessage()
        if message not in logged:
            logged.add(message)
            logging.getLogger(record.name).handle(record)


_compute: list[Callable[[Any], list[Any]]] = []  # one item in a worker process
_records: SimpleQueue[logging.LogRecord] = SimpleQueue()  # of the present block


def is_worker() -> bool:
    """Return whether this process computes blocks for another one."""
    return bool(_compute)


def start_worker(compute: Callable[[Any], list[Any]]) -> None:
    """Initialise a worker process.

    Workers write nothing to the terminal, which would break the progress display: what they log is
    sent with the outputs.

    Args:
        compute: Function that computes blocks.
    """
    logging.getLogger().addHandler(logging.handlers.QueueHandler(_records))
    logging.captureWarnings(True)
    _compute[:] = [compute]


def _computed(items: Sequence[Any]) -> Done:
    """Return the outputs of a block, in a worker process."""
    began = perf_counter()
    outputs = _compute[0](items)
    seconds = perf_counter() - began
    return Done(outputs, seconds, [_records.get() for _ in range(_records.qsize())])
