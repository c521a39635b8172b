"""Regions in the plane, and exact bounds of their distance from pieces of a curve."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput

_ROUNDING = 1e-9
"""Share of the size of a polygon by which a corner may be out of order."""

_SIDES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
"""Pairs of the four Bezier points of a piece; the sides of their convex hull are among them."""


@dataclass(frozen=True)
class Disc:
    """Disc in W.

    Attributes:
        x: Position of the centre along the x axis, in m.
        y: Position of the centre along the y axis, in m.
        radius: Radius, in m.

    Raises:
        InvalidInput: A number is not finite, or the radius is not positive.
    """

    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        if not np.isfinite((self.x, self.y, self.radius)).all() or self.radius <= 0.0:
            raise InvalidInput(
                f"a disc needs a finite centre and a positive radius, got ({self.x:g}, "
                f"{self.y:g}) m and {self.radius:g} m"
            )

    def __str__(self) -> str:
        """Return a short description, for messages."""
        return f"disc of radius {self.radius:g} m at ({self.x:g}, {self.y:g})"

    @property
    def vertices(self) -> Float[Array, "1 2"]:
        """The centre, in m."""
        return np.array([[self.x, self.y]])

    @property
    def rounding(self) -> float:
        """Distance from the vertices up to which points belong to the region, in m."""
        return self.radius

    def depth(self, points: Float[Array, "*n 2"]) -> Float[Array, "*n"]:
        """Return how far points are inside, in m; negative outside. It is a concave function."""
        depth: Float[Array, "*n"] = self.radius - np.linalg.norm(points - self.vertices[0], axis=-1)
        return depth


@dataclass(frozen=True)
class ConvexPolygon:
    """Convex polygon in W.

    Attributes:
        corners: Corners (x, y) in order, clockwise or counter-clockwise, in m; at least three.

    Raises:
        InvalidInput: A number is not finite, or the corners are not those of a convex polygon in
            order.
    """

    corners: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        corners = np.array(self.corners, float)
        if corners.ndim != 2 or corners.shape[1:] != (2,) or not np.isfinite(corners).all():
            raise InvalidInput("the corners of a polygon must be pairs of finite numbers")
        sides = np.roll(corners, -1, axis=0) - corners
        after = np.roll(sides, -1, axis=0)
        turns = sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]
        minimum = _ROUNDING * float(np.ptp(corners, axis=0).max()) ** 2
        angles = np.arctan2(turns, (sides * after).sum(axis=1))
        if (
            len(corners) < 3
            or not ((turns > minimum).all() or (turns < -minimum).all())
            or abs(abs(angles.sum()) - 2.0 * np.pi) > 0.1
        ):
            raise InvalidInput(
                f"the {len(corners)} corners of the polygon at ({corners[0, 0]:g}, "
                f"{corners[0, 1]:g}) are not those of a convex polygon in order; split it into "
                "convex ones, and remove corners on straight sides"
            )

    def __str__(self) -> str:
        """Return a short description, for messages."""
        x, y = np.mean(self.corners, axis=0)
        return f"polygon with {len(self.corners)} corners around ({x:.4g}, {y:.4g})"

    @cached_property
    def vertices(self) -> Float[Array, "corners 2"]:
        """The corners, in m."""
        return np.array(self.corners, float)

    @property
    def rounding(self) -> float:
        """Distance from the vertices up to which points belong to the region: 0."""
        return 0.0

    @cached_property
    def normals(self) -> Float[Array, "corners 2"]:
        """Outward unit normals of the sides."""
        sides = np.roll(self.vertices, -1, axis=0) - self.vertices
        normals = np.stack([sides[:, 1], -sides[:, 0]], axis=1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        outward = ((self.vertices.mean(axis=0) - self.vertices) * normals).sum(axis=1)
        normals *= -np.sign(outward)[:, None]
        return normals

    @cached_property
    def offsets(self) -> Float[Array, " corners"]:
        """Distances of the sides from the origin of W along their normals, in m."""
        offsets: Float[Array, " corners"] = (self.normals * self.vertices).sum(axis=1)
        return offsets

    def depth(self, points: Float[Array, "*n 2"]) -> Float[Array, "*n"]:
        """Return the least distance inside of the lines of the sides, in m; negative outside."""
        depth: Float[Array, "*n"] = (self.offsets - points @ self.normals.T).min(axis=-1)
        return depth


Region: TypeAlias = Disc | ConvexPolygon


def separation(
    region: Region, bezier: Float[Array, "pieces 4 2"]
) -> tuple[Float[Array, " pieces"], Float[Array, "pieces 2"]]:
    """Return a lower bound of the distance from pieces of a curve to a region, in m.

    For a unit vector n, the least of n p over the Bezier points p minus the largest of n v over the
    vertices v of the region is a lower bound of the distance of the two convex hulls, and the
    largest such value is that distance where they are apart (separating axis theorem). The vectors
    compared include the best one.

    Returns:
        Lower bounds, negative or 0 where the hulls may meet, and the vectors n.
    """
    vertices = region.vertices
    starts, ends = bezier[:, _SIDES[:, 0]], bezier[:, _SIDES[:, 1]]
    sides = ends - starts
    square = np.maximum((sides**2).sum(axis=-1), 1e-300)[..., None]
    from_vertex = starts[:, :, None] - vertices
    part = np.clip(-(from_vertex * sides[:, :, None]).sum(axis=-1) / square, 0.0, 1.0)
    nearest = (from_vertex + part[..., None] * sides[:, :, None]).reshape(len(bezier), -1, 2)
    across = np.stack([sides[..., 1], -sides[..., 0]], axis=-1)
    candidates = [nearest, across, -across]
    if isinstance(region, ConvexPolygon):
        candidates.append(np.broadcast_to(region.normals, (len(bezier), *region.normals.shape)))
    normals = np.concatenate(candidates, axis=1)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.where(length > 1e-12, normals / np.maximum(length, 1e-12), [1.0, 0.0])
    low = np.einsum("knd,kjd->knj", normals, bezier).min(axis=-1)
    bounds = low - np.einsum("knd,jd->knj", normals, vertices).max(axis=-1)
    best = bounds.argmax(axis=1)
    every = np.arange(len(bezier))
    return bounds[every, best] - region.rounding, normals[every, best]


def distance(region: Region, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
    """Return the distance of points from a region, in m; not positive inside."""
    return separation(region, np.repeat(points[:, None], 4, axis=1))[0]
