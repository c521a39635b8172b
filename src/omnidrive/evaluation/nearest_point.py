"""Nearest point of a path, searched along the motion of a robot."""

from __future__ import annotations

from math import hypot, inf, sqrt

from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled

SAME = 1e-9
"""Difference of distances, m, that counts as none."""
EARLY = 1e-9
"""Time, s, by which a point may be ahead of the reference and counts as reached."""


@compiled
def find_nearest(  # noqa: PLR0917
    times: Float[Array, " points"],
    points: Float[Array, "points 2"],
    t: Float[Array, " rows"],
    poses: Float[Array, "runs rows 3"],
    behind: int,
    ahead: int,
    nearest: Int[Array, "runs rows"],
) -> None:
    """Fill in the index of the nearest point for each sample of each run.

    It is searched from ``behind`` points before to ``ahead`` points after that of the sample
    before. Of points with the same distance it is the last one that the reference has reached, or
    the first one.
    """
    for r in range(len(poses)):
        at = 0
        for k in range(len(t)):
            x, y = poses[r, k, 0], poses[r, k, 1]
            start, end = max(at - behind, 0), min(at + ahead + 1, len(points))
            square = inf
            for i in range(start, end):
                dx, dy = points[i, 0] - x, points[i, 1] - y
                square = min(square, dx * dx + dy * dy)
            near = sqrt(square) * (1.0 + 1e-12) + 2.0 * SAME  # safely above the distances to check
            near *= near
            least = inf
            for i in range(start, end):
                dx, dy = points[i, 0] - x, points[i, 1] - y
                if dx * dx + dy * dy <= near:
                    least = min(least, hypot(dx, dy))
            at = -1
            for i in range(start, end):
                dx, dy = points[i, 0] - x, points[i, 1] - y
                if dx * dx + dy * dy > near or hypot(dx, dy) > least + SAME:
                    continue
                if at < 0 or times[i] < t[k] + EARLY:
                    at = i
            nearest[r, k] = at
