"""Base classes of the shapes: a curve, and its heading."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.parameter import Bounds, check_bounds, check_choice
from omnidrive.reference.timing.piecewise_path import PathDerivatives

ShapeHeading = Literal["tangent", "fixed"]
"""Heading along the direction of travel; heading of the start."""


@dataclass(frozen=True, kw_only=True)
class Shape(ABC):
    """Poses as a function of s in [0, 1], in the frame of the start pose; abstract.

    Raises:
        InvalidInput: A parameter is out of its range.
    """

    ramp: Annotated[float, Bounds(0.0, 0.5, "1")] = 0.25
    """Share of the duration in which the motion accelerates from rest, and likewise decelerates to
    rest. 0: uniform motion, which starts and ends at full speed."""

    def __post_init__(self) -> None:
        check_bounds(self)

    @abstractmethod
    def evaluate(self, s: Float[Array, " n"]) -> PathDerivatives:
        """Return poses and their first and second derivatives with respect to s.

        x and y in m, yaw in rad, unwrapped, in the frame of the start pose; the position at s = 0
        is the origin.
        """


@dataclass(frozen=True, kw_only=True)
class PlaneCurve(Shape):
    """Plane curve without cusps, with the heading tangent to it or constant; abstract."""

    heading: ShapeHeading = "tangent"
    """`tangent`: direction of travel; `fixed`: heading of the start."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("heading", self.heading, get_args(ShapeHeading))

    @abstractmethod
    def points(self, s: Float[Array, " n"]) -> Float[Array, "4 n 2"]:
        """Return x and y (m), and their first three derivatives with respect to s.

        They are in the frame of the start; s is in [0, 1], and the first axis is the order of the
        derivative.
        """

    @abstractmethod
    def directions(self, s: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the direction of travel from the x axis of the start in rad, continuous in s."""

    def evaluate(self, s: Float[Array, " n"]) -> PathDerivatives:
        """Return poses and derivatives, see :meth:`Shape.evaluate`.

        With p' = (x', y'), the tangent heading has the derivative (x' y'' - y' x'') / |p'|^2, and
        its second derivative follows by the quotient rule.
        """
        values = self.points(s)
        derivatives = np.zeros((3, len(s), 3))
        derivatives[:, :, :2] = values[:3]
        if self.heading == "tangent":
            (x1, y1), (x2, y2), (x3, y3) = (each.T for each in values[1:])
            square = x1 * x1 + y1 * y1
            yaw = derivatives[:, :, 2]
            yaw[0] = self.directions(s)
            yaw[1] = (x1 * y2 - y1 * x2) / square
            yaw[2] = (x1 * y3 - y1 * x3 - 2.0 * (x1 * x2 + y1 * y2) * yaw[1]) / square
        return PathDerivatives(*derivatives)


def harmonics(angle: Float[Array, " n"], rate: float) -> Float[Array, "4 n"]:
    """Return the sine of ``angle = rate * s`` and its first three derivatives with respect to s."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.stack([sine, rate * cosine, -(rate**2) * sine, -(rate**3) * cosine])
