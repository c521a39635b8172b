"""Searches that can be interrupted, and take turns until the time is over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from jaxtyping import Int32

from omnidrive.arrays import Array
from omnidrive.planning.search.astar import INFINITE, Progress


class Run(Protocol):
    """Search that continues where it was interrupted."""

    progress: Progress

    def explore(self, most: int, /) -> bool:
        """Expand up to ``most`` cells; return whether the search has ended."""

    def path(self) -> Int32[Array, " cells"]:
        """Return the bit indices of the best path so far, empty if there is none."""

    @property
    def lower_bound(self) -> float:
        """Cost that no path falls below, in cell widths."""


def completed(run: Run) -> tuple[Int32[Array, " cells"], int]:
    """Run a search to its end; return the cells of its path and the number of expansions."""
    run.explore(INFINITE)
    return run.path(), run.progress.expansions


def has_path(run: Run) -> bool:
    """Whether a search has a path so far."""
    return run.progress.best != INFINITE


class Turn(NamedTuple):
    """Search among several, and its share.

    Attributes:
        run: The search.
        expansions: Number of expansions between two looks at the clock, about half a millisecond.
        is_exact: Whether its path is optimal when it ends.
    """

    run: Run
    expansions: int
    is_exact: bool


def interleave(turns: Sequence[Turn], is_over: Callable[[bool], bool]) -> bool:
    """Let searches take turns until an exact one ends; the first one stops at the first path.

    Args:
        turns: The searches; without a path in one there is none in the others.
        is_over: Whether the time is over; called with whether there is a path.

    Returns:
        Whether an exact search ended, or any without a path.
    """
    active = list(turns)
    while True:
        for turn in tuple(active):
            found = any(has_path(each.run) for each in turns)
            if is_over(found):
                return False
            if turn is turns[0] and found:
                active.remove(turn)
            elif turn.run.explore(turn.expansions):
                if turn.is_exact or not has_path(turn.run):
                    return True
                active.remove(turn)
