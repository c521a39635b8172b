"""Square with rounded corners."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.parameter import Bounds
from omnidrive.reference.shapes.shape import PlaneCurve

_EDGES = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


class _Blend(NamedTuple):
    """Position of points relative to the nearest corner, and the blend of the edges there."""

    corner: Int[Array, " n"]
    """Number of the corner, from 0 at the start."""
    before: Int[Array, " n"]
    """Number of the edge that ends at the corner."""
    after: Int[Array, " n"]
    """Number of the edge that begins there; at both ends of the motion, the same edge."""
    distance: Float[Array, " n"]
    """Distance after the corner along the edges, m."""
    share: Float[Array, " n"]
    """Share of the blend, 0 before it and 1 after it."""


@dataclass(frozen=True, kw_only=True)
class Square(PlaneCurve):
    """Square from corner to corner: straight edges with blends of continuous acceleration.

    The velocity turns from one edge to the next by the weight 6 w^5 - 15 w^4 + 10 w^3 within
    ``rounding`` of a corner: linear segments with blends (Craig, "Introduction to Robotics", ch.
    7.3), with this weight instead of a linear one. The motion slows down in a corner to 0.71 of its
    speed, does not stop there, and passes it at a distance of 0.22 times ``rounding``. It starts
    and ends at the corner at the origin, which is rounded only between two laps.
    """

    side: Annotated[float, Bounds(0.02, 1000.0, "m")] = 2.0
    """Side, m; the first edge runs along the x axis of the start."""
    rounding: Annotated[float, Bounds(0.001, 500.0, "m")] = 0.3
    """Distance from a corner at which the rounding begins, m; at most half the side."""
    laps: Annotated[int, Bounds(1, 100, "")] = 1
    """Number of laps."""
    clockwise: bool = False
    """Whether the motion is clockwise; the square is then on the right of the start."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rounding > 0.5 * self.side:
            raise InvalidInput(
                f"rounding is {self.rounding:g} m, need at most half the side, "
                f"{0.5 * self.side:g} m"
            )

    def points(self, s: Float[Array, " n"]) -> Float[Array, "4 n 2"]:
        """Return x and y, and their derivatives, see :meth:`PlaneCurve.points`."""
        at, wide = self._blend(s), 2.0 * self.rounding
        w = at.share
        # integral of the weight over the distance, the weight, and its first two derivatives
        blended = wide * (w**6 - 3.0 * w**5 + 2.5 * w**4) + np.maximum(
            at.distance - self.rounding, 0.0
        )
        weights = (
            _weight(w),
            30.0 * (w * (1.0 - w)) ** 2 / wide,
            60.0 * w * (1.0 - w) * (1.0 - 2.0 * w) / wide**2,
        )
        first, change = _EDGES[at.before % 4], _EDGES[at.after % 4] - _EDGES[at.before % 4]
        corner = self.side * _CORNERS[at.corner % 4]
        length = 4.0 * self.laps * self.side
        points = np.stack(
            [
                corner + at.distance[:, None] * first + blended[:, None] * change,
                length * (first + weights[0][:, None] * change),
                length**2 * weights[1][:, None] * change,
                length**3 * weights[2][:, None] * change,
            ]
        )
        points[:, :, 1] *= self._side
        return points

    def directions(self, s: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the direction of travel in rad, continuous in s."""
        at = self._blend(s)
        weight = _weight(at.share)
        turn = (at.after - at.before) * np.arctan2(weight, 1.0 - weight)
        direction: Float[Array, " n"] = self._side * (0.5 * pi * at.before + turn)
        return direction

    @property
    def _side(self) -> float:
        return -1.0 if self.clockwise else 1.0

    def _blend(self, s: Float[Array, " n"]) -> _Blend:
        """Return the nearest corner of each point."""
        last = 4 * self.laps
        edges = s * last
        corner = np.clip(np.rint(edges), 0, last).astype(int)
        distance = self.side * (edges - corner)
        share = np.clip((distance / self.rounding + 1.0) / 2.0, 0.0, 1.0)
        return _Blend(
            corner, np.maximum(corner - 1, 0), np.minimum(corner, last - 1), distance, share
        )


def _weight(share: Float[Array, " n"]) -> Float[Array, " n"]:
    """Return 6 w^5 - 15 w^4 + 10 w^3."""
    weight: Float[Array, " n"] = share**3 * (10.0 + share * (6.0 * share - 15.0))
    return weight
