"""Readings of the last seconds, into which late pose fixes are inserted at their stamps."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterator
from dataclasses import dataclass, field

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.estimation.pose_filter.filter_state import FilterState
from omnidrive.estimation.readings import PoseFix
from omnidrive.geometry import Pose

MAX_STORED = 200
"""Largest number of stored readings and fixes, which bounds the time of an update."""
MAX_FIXES = 20
"""Largest number of fixes that are used of one update."""


@dataclass(order=True, slots=True)
class BufferedFix:
    """A received fix; ordered by its stamp."""

    fix: PoseFix
    accepted: bool = field(default=False, compare=False)
    relocated: bool = field(default=False, compare=False)
    """Whether the robot was moved without its wheels shortly before the stamp."""
    starts: bool = field(default=False, compare=False)
    """Whether the filter starts at this fix, because the pose was unknown before."""
    prior: Pose = field(default=Pose(0.0, 0.0, 0.0), compare=False)
    """Estimated pose at the stamp, before the correction."""


@dataclass(slots=True)
class Interval:
    """Readings between two consecutive updates."""

    begin: float
    end: float
    displacements: Float[Array, " wheels"]
    yaw_rate: float
    initial: FilterState
    """Filter state at ``begin``."""
    fixes: list[BufferedFix] = field(default_factory=list)


@dataclass(slots=True)
class ReadingBuffer:
    """The intervals of the last seconds.

    Attributes:
        memory: Time for which readings are stored, s.
        intervals: In the order of time; each begins where the one before ends.
    """

    memory: float
    intervals: list[Interval] = field(default_factory=list)

    @property
    def latest_fixes(self) -> Iterator[tuple[int, BufferedFix]]:
        """All fixes, the latest stamp first, each with the index of its interval."""
        for i in range(len(self.intervals) - 1, -1, -1):
            for item in reversed(self.intervals[i].fixes):
                yield i, item

    def insert(self, item: BufferedFix) -> int | None:
        """Insert a fix into the interval that contains its stamp; return the interval's index.

        None: the fix is older than all intervals.
        """
        stamp = item.fix.stamp
        last = bisect_right(self.intervals, stamp, key=lambda interval: interval.begin)
        for i in range(last - 1, -1, -1):
            interval = self.intervals[i]
            if interval.begin < stamp or interval.begin == interval.end == stamp:
                insort(interval.fixes, item)
                return i
        return None

    def prune(self) -> None:
        """Remove all intervals that ended before ``memory``, except the last one.

        The oldest ones are removed as well while more than :data:`MAX_STORED` readings and fixes
        are stored.
        """
        before = self.intervals[-1].end - self.memory
        stored = sum(1 + len(each.fixes) for each in self.intervals)
        first = 0
        for each in self.intervals[:-1]:
            if each.end >= before and stored <= MAX_STORED:
                break
            stored -= 1 + len(each.fixes)
            first += 1
        self.intervals = self.intervals[first:]
