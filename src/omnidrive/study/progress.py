"""Progress of a study of one scenario, by its parts."""

from __future__ import annotations

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
