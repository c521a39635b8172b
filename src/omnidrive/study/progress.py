"""Progress of a study, by its parts and runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter
from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.evaluation.run_record import RunRecord


class RunProgress(NamedTuple):
    """Progress of the runs of a study."""

    done: int
    """Stored runs."""
    total: int
    """Planned runs."""
    unfinished: int
    """Runs of this call that ended early."""
    remaining: float
    """Estimated remaining time, s; infinite: unknown."""
    best: tuple[str, float] | None
    """Controller with the least mean ``me`` of the runs of this call, and that mean, m."""
    latest: Sequence[RunRecord] = ()
    """Records of the latest block of runs."""


@runtime_checkable
class ProgressListener(Protocol):
    """Receiver of progress notifications."""

    def part(self, name: str, steps: int) -> None:
        """Handle the start of a part with ``steps`` steps (0: unknown number)."""
        ...

    def done(self, what: str) -> None:
        """Handle the end of one step of the part; ``what`` names it."""
        ...

    def runs(self, progress: RunProgress) -> None:
        """Handle the progress of the part ``simulate``, whose steps are runs."""
        ...

    def note(self, text: str) -> None:
        """Handle one line about a stop rule that has been checked."""
        ...


class NullProgress:
    """A :class:`ProgressListener` that does nothing."""

    def part(self, name: str, steps: int) -> None:
        """Do nothing."""

    def done(self, what: str) -> None:
        """Do nothing."""

    def runs(self, progress: RunProgress) -> None:
        """Do nothing."""

    def note(self, text: str) -> None:
        """Do nothing."""


@dataclass(slots=True)
class Stopwatch:
    """Stopwatch of the parts of a study, which also notifies a listener."""

    progress: ProgressListener
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def part(self, name: str, steps: int) -> Iterator[None]:
        """Notify the listener of a part and measure the wall time of the block."""
        self.progress.part(name, steps)
        began = perf_counter()
        yield
        self.seconds[name] = round(perf_counter() - began, 3)
