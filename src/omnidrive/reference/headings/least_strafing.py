"""Headings near the direction of travel, with smooth turns to given headings at the ends."""

from __future__ import annotations

from omnidrive.planning import SplinePath
from omnidrive.reference.headings.heading_spline import PathSamples


def least_strafing(
    path: SplinePath, start_yaw: float | None = None, goal_yaw: float | None = None
) -> SplinePath:
    """Return the path with headings as near to the direction of travel as smooth turns allow.

    With the arc length s, the heading a(s), the angle r(s) between it and the direction of travel,
    and the curvature c(s) of the path, at most 1 / l in magnitude, the control points of the
    heading minimise the integral over s of

        (2 sin(r / 2))^2 + l^2 (da/ds - c)^2

    with l = 0.4 m. For small angles the first term is the square of the sideways share of the
    motion, sin(r)^2; beyond a right angle it still grows, so that the robot does not drive
    backward. Where the path is not more curved, the heading comes from r0 at the start as
    r = 4 atan(exp(-s / l) tan(r0 / 4)): it turns by at most 2 / l = 5 rad/m beside the turn of the
    path. Where the path turns on the spot, or is slower in its parameter than half the mean, turns
    cost as much as at half the mean.

    The minimum is found by iteratively reweighted least squares: r^2 sin(r0) / r0 plus a constant
    is an upper bound of the first term for angles up to pi that touches it at r0, so that no
    iteration increases the integral (Hunter & Lange 2004, "A Tutorial on MM Algorithms").

    Args:
        path: Path to follow; it may reverse, or turn on the spot.
        start_yaw: Heading at the start, rad, modulo whole turns, met exactly; None: free, or that
            of a path that only turns on the spot.
        goal_yaw: Heading at the goal, likewise.
    """
    samples = PathSamples.of(path)
    return samples.nearest(samples.along_travel(), start_yaw, goal_yaw)
