"""Division of a motion through waypoints into splines, and of splines into pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint

_PIECES = 20
"""Number of pieces that all legs share by their lengths."""

_LEAST = 5
"""Smallest number of pieces of a leg."""


class Part(NamedTuple):
    """Pieces of one spline.

    Attributes:
        spline: Index of the spline.
        first: First piece, counted in the spline.
        last: Piece after the last one; equal to :attr:`first` for the point between two pieces.
    """

    spline: int
    first: int
    last: int


class Layout(NamedTuple):
    """Splines from stop to stop, with a whole number of pieces from waypoint to waypoint.

    Attributes:
        nodes: Path parameter s of each waypoint; s increases by 1 on each piece of all splines.
        stops: Indices of the waypoints at which splines start and end.
    """

    nodes: Int[Array, " waypoints"]
    stops: Int[Array, " stops"]

    @classmethod
    def of(cls, waypoints: Sequence[MotionWaypoint], lengths: Float[Array, " legs"]) -> Layout:
        """Return the layout for legs of the given lengths, in m."""
        share = lengths / max(float(lengths.sum()), 1e-9)
        counts = np.maximum(np.round(_PIECES * share), _LEAST).astype(int)
        stops = [0, *(k for k, w in enumerate(waypoints[1:-1], 1) if w.stop), len(waypoints) - 1]
        return cls(np.concatenate([[0], np.cumsum(counts)]), np.array(stops))

    @property
    def starts(self) -> Int[Array, " stops"]:
        """Path parameter at each stop."""
        starts: Int[Array, " stops"] = self.nodes[self.stops]
        return starts

    @property
    def pieces(self) -> Int[Array, " splines"]:
        """Number of pieces of each spline."""
        pieces: Int[Array, " splines"] = np.diff(self.starts)
        return pieces

    def waypoints(self, spline: int) -> range:
        """Return the indices of the waypoints of a spline, its ends included."""
        return range(int(self.stops[spline]), int(self.stops[spline + 1]) + 1)

    def local(self, spline: int, waypoint: int) -> int:
        """Return the path parameter of a waypoint in a spline."""
        return int(self.nodes[waypoint] - self.starts[spline])

    def parts(self, first: int, last: int) -> Iterator[Part]:
        """Yield the pieces from one waypoint to another; a point if both are the same.

        A stop is the end of one spline and the start of the next, and is yielded once.
        """
        low, high = int(self.nodes[first]), int(self.nodes[last])
        for spline, (start, end) in enumerate(
            zip(self.starts[:-1].tolist(), self.starts[1:].tolist(), strict=True)
        ):
            a, b = max(low, start), min(high, end)
            if a < b:
                yield Part(spline, a - start, b - start)
            elif first == last and start <= low < end + (end == self.starts[-1]):
                yield Part(spline, low - start, low - start)

    def held(self, sections: Sequence[MotionSection], spline: int) -> list[tuple[int, int]]:
        """Return the runs of control points of a spline whose headings are equal.

        They are those of pieces in sections with a yaw rate of 0. Each run is given by its first
        and its last control point; piece k depends on the control points k to k + 3.
        """
        runs: list[tuple[int, int]] = []
        spans = sorted(
            (part.first, part.last + 2)
            for each in sections
            if each.max_yaw_rate == 0.0
            for part in self.parts(each.first, each.last)
            if part.spline == spline
        )
        for low, high in spans:
            if runs and low <= runs[-1][1]:
                runs[-1] = (runs[-1][0], max(high, runs[-1][1]))
            else:
                runs.append((low, high))
        return runs
