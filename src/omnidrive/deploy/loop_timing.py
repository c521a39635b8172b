"""Punctuality of a real-time loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

EDGES = (0.0, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, np.inf)
"""Edges of the histogram of the jitter, s."""
_BARS = 40


class TimingSummary(NamedTuple):
    """Figures of the punctuality of a loop."""

    samples: int
    """Number of samples."""
    misses: int
    """Number of times that a command was sent after the next sample was due; samples are skipped
    then."""
    skipped: int
    """Number of samples that were skipped."""
    jitter_median: float
    """Median time from the deadline of a sample to its begin, s."""
    jitter_p99: float
    """99th percentile of it, s."""
    jitter_max: float
    """Largest, s."""
    busy_median: float
    """Median time from the begin of a sample until its command is sent, s."""
    busy_p99: float
    """99th percentile of it, s."""
    busy_max: float
    """Largest, s."""

    @property
    def miss_share(self) -> float:
        """Share of samples that missed their deadline."""
        return self.misses / self.samples if self.samples else 0.0


@dataclass(slots=True)
class LoopTiming:
    """Times of the samples of a loop, in arrays that are allocated in advance.

    Attributes:
        skipped: Number of samples that were skipped.
        misses: Number of times that a command was sent after the next sample was due.
    """

    capacity: int
    skipped: int = 0
    misses: int = 0
    _late: np.ndarray = field(init=False, repr=False)
    _busy: np.ndarray = field(init=False, repr=False)
    _count: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._late, self._busy = np.zeros(self.capacity), np.zeros(self.capacity)

    def add(self, late: float, busy: float) -> None:
        """Note one sample: lateness of its begin and time until its command is sent, s."""
        i = self._count % self.capacity
        self._late[i], self._busy[i] = late, busy
        self._count += 1

    @property
    def lateness(self) -> Float[Array, " samples"]:
        """Time from deadline to begin of the last ``capacity`` samples, in order, s."""
        return self._in_order(self._late)

    @property
    def busy(self) -> Float[Array, " samples"]:
        """Time from begin to command of the last ``capacity`` samples, in order, s."""
        return self._in_order(self._busy)

    def _in_order(self, times: Float[Array, " capacity"]) -> Float[Array, " samples"]:
        if self._count <= self.capacity:
            return times[: self._count]
        return np.roll(times, -(self._count % self.capacity))

    def summary(self) -> TimingSummary:
        """Return the figures; of the last ``capacity`` samples."""
        count = min(self._count, self.capacity)
        if count == 0:
            return TimingSummary(0, 0, 0, *(6 * (0.0,)))
        late, busy = self._late[:count], self._busy[:count]
        figures = [float(np.percentile(x, q)) for x in (late, busy) for q in (50, 99, 100)]
        return TimingSummary(self._count, self.misses, self.skipped, *figures)

    def histogram(self) -> str:
        """Return the histogram of the jitter as lines of text."""
        count = min(self._count, self.capacity)
        counts = np.histogram(self._late[:count], EDGES)[0]
        lines = []
        for low, high, number in zip(EDGES, EDGES[1:], counts, strict=False):
            name = f"{1e3 * low:g} to {1e3 * high:g} ms" if high < np.inf else f"{1e3 * low:g} ms +"
            bar = "#" * round(_BARS * number / max(count, 1))
            lines.append(f"{name:>14} {number:>8} {bar}".rstrip())
        return "\n".join(lines)
