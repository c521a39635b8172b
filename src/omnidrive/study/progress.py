"""Progress of a study of one scenario, by its parts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter
from typing import Protocol, runtime_checkable


@runtime_checkable
class ProgressListener(Protocol):
    """Receiver of progress notifications."""

    def part(self, name: str, steps: int) -> None:
        """Handle the start of a part with ``steps`` steps (0: unknown number)."""
        ...

    def done(self, what: str) -> None:
        """Handle the end of one step of the part; ``what`` names it."""
        ...


class NullProgress:
    """A :class:`ProgressListener` that does nothing."""

    def part(self, name: str, steps: int) -> None:
        """Do nothing."""

    def done(self, what: str) -> None:
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
