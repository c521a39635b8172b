"""Slalom of clothoids."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.special import fresnel

from omnidrive.arrays import Array
from omnidrive.parameter import Bounds
from omnidrive.reference.shapes.shape import PlaneCurve


class _Clothoids(NamedTuple):
    """Segments of linear curvature; the arrays hold the values at the start of each."""

    start: Float[Array, " segments"]
    """Arc length from the start of the path, m."""
    direction: Float[Array, " segments"]
    """Direction of travel from the x axis of the start, rad."""
    curvature: Float[Array, " segments"]
    """Curvature, 1/m."""
    sharpness: Float[Array, " segments"]
    """Derivative of the curvature with respect to arc length, 1/m^2."""
    position: Complex[Array, " segments"]
    """x + i y in the frame of the start, m."""


@dataclass(frozen=True, kw_only=True)
class Slalom(PlaneCurve):
    """Slalom along the x axis of the start: clothoids of equal sharpness.

    It begins to the left and weaves about a line parallel to the x axis, at y > 0. |dp/ds| is
    constant.

    The curvature is a triangular wave over arc length, so that a segment is a clothoid, whose
    points are Fresnel integrals (Meek & Walton, "The use of Cornu spirals in drawing planar curves
    of controlled curvature", 1989). The direction turns left from 0 to ``angle``, then ``gates``
    times between ``angle`` and ``-angle``, and finally back to 0.
    """

    gates: Annotated[int, Bounds(1, 100, "")] = 4
    """Number of swings of the direction between `angle` and `-angle`. If it is odd, the slalom ends
    on the x axis of the start; if it is even, at twice the y of its centre line."""
    angle: Annotated[float, Bounds(0.01, 1.5, "rad")] = 0.7
    """Largest angle between the direction of travel and the x axis of the start, rad."""
    curvature: Annotated[float, Bounds(0.001, 100.0, "1/m")] = 1.5
    """Largest curvature, 1/m."""

    def points(self, s: Float[Array, " n"]) -> Float[Array, "4 n 2"]:
        """Return x and y, and their derivatives, see :meth:`PlaneCurve.points`."""
        segments, total = self._segments
        which, along = self._locate(s)
        curvature = segments.curvature[which] + segments.sharpness[which] * along
        tangent = np.exp(1j * self.directions(s))
        position = segments.position[which] + _clothoid(
            segments.direction[which], segments.curvature[which], segments.sharpness[which], along
        )
        second = 1j * curvature * tangent
        third = (1j * segments.sharpness[which] - curvature**2) * tangent
        values = np.stack([position, total * tangent, total**2 * second, total**3 * third])
        return np.stack([values.real, values.imag], axis=2)

    def directions(self, s: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the direction of travel in rad; it stays within ``angle`` of 0."""
        segments, _ = self._segments
        which, along = self._locate(s)
        turned = along * (segments.curvature[which] + 0.5 * segments.sharpness[which] * along)
        direction: Float[Array, " n"] = segments.direction[which] + turned
        return direction

    def _locate(self, s: Float[Array, " n"]) -> tuple[Array, Float[Array, " n"]]:
        """Return the segment of each point and the arc length within it, m."""
        segments, total = self._segments
        length = total * s
        which = np.clip(
            np.searchsorted(segments.start, length, side="right") - 1, 0, len(segments.start) - 1
        )
        return which, length - segments.start[which]

    @cached_property
    def _segments(self) -> tuple[_Clothoids, float]:
        """All segments, and the total arc length in m.

        A swing by an angle a consists of two segments of length h: a = c h^2 with the sharpness c,
        and the peak curvature is c h. That of a full swing, a = 2 ``angle``, is ``curvature``.
        """
        sharpness = self.curvature**2 / (2.0 * self.angle)
        full, half = 2.0 * self.angle / self.curvature, sqrt(self.angle / sharpness)
        sides = np.where(np.arange(self.gates + 2) % 2, -1.0, 1.0)
        steps = np.repeat([half, *[full] * self.gates, half], 2)
        slopes = np.repeat(sides, 2) * np.tile([1.0, -1.0], self.gates + 2) * sharpness
        curvature = np.concatenate([[0.0], np.cumsum(slopes * steps)[:-1]])
        turns = steps * (curvature + 0.5 * slopes * steps)
        direction = np.concatenate([[0.0], np.cumsum(turns)[:-1]])
        moves = _clothoid(direction, curvature, slopes, steps)
        position = np.concatenate([[0.0], np.cumsum(moves)[:-1]])
        starts = np.concatenate([[0.0], np.cumsum(steps)])
        segments = _Clothoids(starts[:-1], direction, curvature, slopes, position)
        return segments, float(starts[-1])


def _clothoid(
    direction: Float[Array, " n"],
    curvature: Float[Array, " n"],
    sharpness: Float[Array, " n"],
    length: Float[Array, " n"],
) -> Complex[Array, " n"]:
    """Return the integral of exp(i (direction + curvature u + sharpness u^2 / 2)) over [0, length].

    Completing the square gives Fresnel integrals C + i S (Abramowitz & Stegun, 7.3).
    """
    scale = np.sqrt(np.abs(sharpness) / pi)
    offset = curvature / sharpness
    (s0, c0), (s1, c1) = fresnel(scale * offset), fresnel(scale * (offset + length))
    integral = (c1 - c0) + 1j * np.sign(sharpness) * (s1 - s0)
    turned = np.exp(1j * (direction - 0.5 * curvature * offset))
    points: Complex[Array, " n"] = turned / scale * integral
    return points
