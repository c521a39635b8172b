"""Nearest point of a path, searched along the motion of a robot."""

from __future__ import annotations

from math import hypot, inf, sqrt

import numpy as np
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
    xs: Float[Array, " points"],
    ys: Float[Array, " points"],
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
    squares = np.empty(behind + ahead + 4)
    for r in range(len(poses)):
        at = 0
        for k in range(len(t)):
            x, y = poses[r, k, 0], poses[r, k, 1]
            start, end = max(at - behind, 0), min(at + ahead + 1, len(xs))
            for i in range(end - start):
                dx, dy = xs[start + i] - x, ys[start + i] - y
                squares[i] = dx * dx + dy * dy
            count = end - start
            for i in range(count, count + 3):
                squares[i] = inf
            a, b, c, d = inf, inf, inf, inf
            for i in range(0, count, 4):  # four independent chains take a quarter of the time
                a, b = min(a, squares[i]), min(b, squares[i + 1])
                c, d = min(c, squares[i + 2]), min(d, squares[i + 3])
            square = min(a, b, c, d)
            # safely above the squares of the distances to check
            near = (sqrt(square) * (1.0 + 1e-12) + 2.0 * SAME) ** 2
            minimum = inf
            for i in range(count):
                if squares[i] <= near:
                    minimum = min(minimum, hypot(xs[start + i] - x, ys[start + i] - y))
            at = -1
            for i in range(count):
                if (
                    squares[i] > near
                    or hypot(xs[start + i] - x, ys[start + i] - y) > minimum + SAME
                ):
                    continue
                if at < 0 or times[start + i] < t[k] + EARLY:
                    at = start + i
            nearest[r, k] = at
