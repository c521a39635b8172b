"""Pose of a laser scanner's robot on a map, by matching the scan with the walls."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.maps import OccupancyGrid

MAX_RAYS = 120
"""Largest number of rays that are matched; of more, evenly spread ones are taken."""
MIN_SHARE = 0.5
"""Least share of rays that end at a wall of the map."""
_MIN_RAYS = 20
_NEAR = 0.1  # m; deviation at which a ray still ends at a wall, in addition to half a cell
_SIGMA = 0.05  # m; standard deviation of a ray's end from the wall of a map
_WIDTHS = np.geomspace(0.5, 0.05, 8)  # m; widths of the weights, one per iteration
_DONE = 1e-5  # m, rad


STANDSTILL = BodyTwist(0.0, 0.0, 0.0)


class ScanMatch(NamedTuple):
    """Result of the matching of one scan."""

    pose: Pose
    """Pose of B in W; m, m, rad."""
    position_sigma: float
    """Standard deviation of the position along its least certain direction, m."""
    yaw_sigma: float
    """Standard deviation of the yaw, rad."""
    share: float
    """Share of the rays that end at a wall of the map, 0 to 1."""

    @property
    def is_usable(self) -> bool:
        """Whether at least :data:`MIN_SHARE` of the rays end at walls."""
        return self.share >= MIN_SHARE


def match_scan(
    grid: OccupancyGrid,
    points: Float[Array, "points 2"],
    prior: Pose,
    sigmas: tuple[float, float] = (0.05, 0.05),
) -> ScanMatch | None:
    """Return the pose at which the points of a scan lie on the walls of a map.

    The maximum a posteriori estimate: Gauss-Newton steps on the squared distances of the points
    from the walls and on the deviation from ``prior``, which decides where the walls do not, as
    along a corridor. Points far from walls have little weight (Geman-McClure), less from step to
    step, so that people and doors disturb little (Lu & Milios, "Robot pose estimation in unknown
    environments by matching 2D range scans", 1997; Barron, "A general and adaptive robust loss
    function", 2019, eq. 13 for alpha = -2).

    Args:
        grid: The map. Unknown cells must be free.
        points: Ends (x, y) of the rays in B, m; finite.
        prior: Expected pose of B in W; m, m, rad.
        sigmas: Standard deviations of the prior: of x and y, m, and of the yaw, rad.

    Returns:
        None: there are fewer than 20 points, or the map has no walls.
    """
    points = points[:: -(-len(points) // MAX_RAYS)] if len(points) else points
    if len(points) < _MIN_RAYS or not grid.occupied.any():
        return None
    position, yaw = sigmas
    weight = np.diag([position**-2, position**-2, yaw**-2])
    expected = np.array(prior)
    pose = expected.copy()
    information = weight
    for width in _WIDTHS:
        distance, jacobian = _linearised(grid, points, pose)
        scaled = jacobian.T * ((1.0 + (distance / width) ** 2) ** -2 / _SIGMA**2)
        information = scaled @ jacobian + weight
        step = np.linalg.solve(information, scaled @ distance + weight @ (pose - expected))
        pose = pose - step
        if width == _WIDTHS[-1] or np.abs(step).max() < _DONE:
            break
    distance, _ = _linearised(grid, points, pose)
    share = float(np.mean(np.abs(distance) <= _NEAR + 0.5 * grid.resolution))
    covariance = np.linalg.inv(information)
    floor = grid.resolution / sqrt(12.0)
    largest = float(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return ScanMatch(
        Pose(*pose.tolist()), hypot(sqrt(largest), floor), sqrt(float(covariance[2, 2])), share
    )


def find_scan(
    grid: OccupancyGrid, points: Float[Array, "points 2"], near: Pose
) -> ScanMatch | None:
    """Return the best match of a scan whose pose is known to 0.4 m along each axis and 0.4 rad.

    The best three of 225 poses on a lattice about ``near`` are matched. Arguments and result as of
    :func:`match_scan`.
    """
    if len(points) < _MIN_RAYS or not grid.occupied.any():
        return None
    few = points[:: -(-len(points) // 60)]
    offsets = np.linspace(-0.4, 0.4, 5)
    lattice = [
        Pose(near.x + dx, near.y + dy, near.yaw + turn)
        for dx in offsets.tolist()
        for dy in offsets.tolist()
        for turn in np.linspace(-0.4, 0.4, 9).tolist()
    ]
    ends = np.concatenate([_in_world(few, np.array(each)) for each in lattice])
    distances = grid.clearance(ends).reshape(len(lattice), len(few))
    scores = np.exp(-0.5 * (distances / 0.2) ** 2).mean(axis=1)
    found = [match_scan(grid, points, lattice[int(i)], (0.5, 0.5)) for i in np.argsort(scores)[-3:]]
    return max((each for each in found if each is not None), key=lambda each: each.share)


def scan_points(
    ranges: Float[Array, " rays"],
    first: float,
    increment: float,
    limits: tuple[float, float],
    mount: Pose,
    *,
    motion: tuple[float, BodyTwist] = (0.0, STANDSTILL),
) -> Float[Array, "points 2"]:
    """Return the ends of the rays of a scan in B at its begin, m; rays without a hit are left out.

    Args:
        ranges: Range of each ray, m; not finite: no hit.
        first: Bearing of the first ray from the x axis of the scanner, rad.
        increment: Angle from one ray to the next, rad.
        limits: Least and largest range of a hit, m.
        mount: Pose of the scanner in B; m, m, rad.
        motion: Time from one ray to the next, s, and the body twist in this time (B; m/s, m/s,
            rad/s), of second order in the angle.
    """
    least, greatest = limits
    hits = np.isfinite(ranges) & (ranges > least) & (ranges < greatest)
    which = np.flatnonzero(hits)
    angles = mount.yaw + first + increment * which
    x = mount.x + ranges[which] * np.cos(angles)
    y = mount.y + ranges[which] * np.sin(angles)
    period, twist = motion
    times = period * which
    turned, half = twist.yaw_rate * times, 0.5 * twist.yaw_rate * times
    c, s, ch, sh = np.cos(turned), np.sin(turned), np.cos(half), np.sin(half)
    return np.column_stack(
        [
            c * x - s * y + times * (ch * twist.vx - sh * twist.vy),
            s * x + c * y + times * (sh * twist.vx + ch * twist.vy),
        ]
    )


def _in_world(
    points: Float[Array, "points 2"], pose: Float[Array, " 3"]
) -> Float[Array, "points 2"]:
    x, y, yaw = pose.tolist()
    c, s = cos(yaw % (2.0 * pi)), sin(yaw % (2.0 * pi))
    ends: Float[Array, "points 2"] = points @ np.array([[c, s], [-s, c]]) + np.array([x, y])
    return ends


def _linearised(
    grid: OccupancyGrid, points: Float[Array, "points 2"], pose: Float[Array, " 3"]
) -> tuple[Float[Array, " points"], Float[Array, "points 3"]]:
    """Return the signed distance of each point from the walls, m, and its derivatives by the pose.

    The derivatives are central differences over half a cell.
    """
    world = _in_world(points, pose)
    h = 0.25 * grid.resolution
    shifted = [world + np.array(d) for d in ((h, 0.0), (-h, 0.0), (0.0, h), (0.0, -h))]
    right, left, above, below = grid.clearance(np.concatenate(shifted)).reshape(4, -1)
    gx, gy = (right - left) / (2.0 * h), (above - below) / (2.0 * h)
    rx, ry = (world - pose[:2]).T
    return 0.25 * (right + left + above + below), np.column_stack([gx, gy, gy * rx - gx * ry])
