"""Simple polygons: the outlines of robots seen from above."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput

_MAX_CORNERS = 200
_FLAT = 1e-12
"""Share of the product of two edge lengths below which their cross product is rounding error."""


@dataclass(frozen=True, eq=False)
class Polygon:
    """Simple polygon in B; its origin is that of B and may lie outside.

    Attributes:
        corners: Corners (x, y) in m, counter-clockwise.
        triangles: Triangles, in m, whose union is the polygon.
    """

    corners: Float[Array, "corners 2"]
    triangles: Float[Array, "triangles 3 2"]

    @classmethod
    def of(cls, footprint: Float[Array, "corners 2"]) -> Polygon:
        """Check a footprint, with corners (x, y) in B in m in either order, and triangulate it.

        Raises:
            InvalidInput: It has fewer than 3 or more than 200 corners, a corner that is not a
                finite number or that occurs twice, or no area, or its edges meet.
        """
        try:
            corners = np.array(footprint, float)
        except (TypeError, ValueError):
            raise InvalidInput(
                "the corners of a footprint must be pairs of numbers, in m"
            ) from None
        check_footprint(corners)
        if len(corners) > _MAX_CORNERS:
            raise InvalidInput(
                f"a footprint may have {_MAX_CORNERS} corners, got {len(corners)}; simplify it"
            )
        _check_simple(corners)
        if _area(corners) < 0.0:
            corners = corners[::-1].copy()
        return cls(corners, _triangles(corners))

    @property
    def radius(self) -> float:
        """Distance in m from the origin of B to the farthest corner."""
        return float(np.hypot(*self.corners.T).max())

    def contains(self, point: Float[Array, " xy"]) -> bool:
        """Whether a point in B, in m, lies in the polygon or on its outline."""
        return any(
            min(_side(a, b, point), _side(b, c, point), _side(c, a, point)) >= 0
            for a, b, c in self.triangles
        )

    @staticmethod
    def turned(points: Float[Array, "*n 2"], yaw: float) -> Float[Array, "*n 2"]:
        """Return points turned counter-clockwise about the origin."""
        along, across = np.cos(yaw), np.sin(yaw)
        turned: Float[Array, "*n 2"] = points @ np.array([[along, across], [-across, along]])
        return turned

    def __str__(self) -> str:
        """Describe the polygon by its extent in B."""
        length, width = np.ptp(self.corners, axis=0).tolist()
        return f"polygon of {len(self.corners)} corners, {length:.4g} x {width:.4g} m"


def check_footprint(polygon: Float[Array, "corners 2"]) -> None:
    """Check that a footprint, with corners (x, y) in B in m, is a polygon.

    Raises:
        InvalidInput: It has fewer than three corners, a corner that is not finite, or no area.
    """
    if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3:
        raise InvalidInput(
            f"a footprint needs at least three corners (x, y), got shape {polygon.shape}"
        )
    if not np.isfinite(polygon).all():
        raise InvalidInput("the corners of a footprint must be finite, in m")
    if np.linalg.matrix_rank(polygon[1:] - polygon[0]) < 2:
        raise InvalidInput("a footprint needs an area, but all its corners lie on one line")


def _area(corners: Float[Array, "corners 2"]) -> float:
    """Return the signed area, positive counter-clockwise (shoelace formula)."""
    after = np.roll(corners, -1, axis=0)
    return 0.5 * float((corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]).sum())


def _side(a: Float[Array, " xy"], b: Float[Array, " xy"], point: Float[Array, " xy"]) -> int:
    """Return 1 if a point lies left of the line from a to b, -1 if right, 0 if on it."""
    along, to = b - a, point - a
    cross = float(along[0] * to[1] - along[1] * to[0])
    flat = _FLAT * float(np.hypot(*along) * np.hypot(*to))
    return 0 if abs(cross) <= flat else (1 if cross > 0.0 else -1)


def _is_between(a: Float[Array, " xy"], b: Float[Array, " xy"], point: Float[Array, " xy"]) -> bool:
    """Whether a point on the line through a and b lies between them, ends included."""
    return bool((np.minimum(a, b) <= point).all() and (point <= np.maximum(a, b)).all())


def _meet(
    a: Float[Array, " xy"], b: Float[Array, " xy"], c: Float[Array, " xy"], d: Float[Array, " xy"]
) -> bool:
    """Whether the segments from a to b and from c to d have a common point."""
    sides = (_side(a, b, c), _side(a, b, d), _side(c, d, a), _side(c, d, b))
    if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
        return True
    ends = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(side == 0 and _is_between(*end) for side, end in zip(sides, ends, strict=True))


def _check_simple(corners: Float[Array, "corners 2"]) -> None:
    """Raise InvalidInput if two edges of a polygon meet elsewhere than at their common corner."""
    count = len(corners)
    for i, j in combinations(range(count), 2):
        if (corners[i] == corners[j]).all():
            raise InvalidInput(
                f"corners {i + 1} and {j + 1} of the footprint coincide; give each corner once"
            )
    for i, j in combinations(range(count), 2):
        a, b, c, d = (corners[k % count] for k in (i, i + 1, j, j + 1))
        if j == i + 1:  # the edges share b = c: they fold back onto each other or do not meet
            meets = _side(a, b, d) == 0 and float((b - a) @ (d - b)) < 0.0
        elif (j + 1) % count == i:
            meets = _side(c, a, b) == 0 and float((a - c) @ (b - a)) < 0.0
        else:
            meets = _meet(a, b, c, d)
        if meets:
            raise InvalidInput(
                f"the footprint is not a simple polygon: its edges {i + 1} and {j + 1} meet "
                "(edge k starts at corner k); give the corners in order along the outline"
            )


def _triangles(corners: Float[Array, "corners 2"]) -> Float[Array, "triangles 3 2"]:
    """Cut a counter-clockwise simple polygon into triangles by ear clipping (Meisters 1975)."""
    left, found = list(range(len(corners))), []
    while len(left) > 3:
        ear = next((at for at in range(len(left)) if _is_ear(corners, left, at)), None)
        if ear is None:  # only corners on a line are left over, up to rounding
            break
        found.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    # the rest as a fan; for a triangle it is the triangle
    found += [[left[0], left[k], left[k + 1]] for k in range(1, len(left) - 1)]
    triangles: Float[Array, "triangles 3 2"] = corners[np.array(found)]
    return triangles


def _is_ear(corners: Float[Array, "corners 2"], left: list[int], at: int) -> bool:
    """Whether the triangle of a corner and its two neighbours lies in the polygon left over."""
    before, here, after = left[at - 1], left[at], left[(at + 1) % len(left)]
    a, b, c = corners[before], corners[here], corners[after]
    turn = _side(a, b, c)
    if turn < 0:
        return False
    if turn == 0:
        return True
    return not any(
        min(_side(a, b, corners[k]), _side(b, c, corners[k]), _side(c, a, corners[k])) >= 0
        for k in left
        if k not in {before, here, after}
    )
