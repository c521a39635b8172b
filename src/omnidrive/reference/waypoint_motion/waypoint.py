"""Waypoints of a motion, and sections between them."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite

import numpy as np

from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.waypoint_motion.regions import Region


@dataclass(frozen=True, slots=True)
class MotionWaypoint:
    """Waypoint of a motion.

    Attributes:
        x: Position of the origin of B in W along the x axis, in m.
        y: Position along the y axis, in m.
        yaw: Heading, in rad, modulo whole turns; None: free.
        stop: Whether the robot stops here; it always does at the first and at the last waypoint.
        fixed: Whether the motion passes the position. If not, the position only guides the initial
            path, and the waypoint bounds legs and sections: the optimisation may shorten a slow
            section that it bounds.
    """

    x: float
    y: float
    yaw: float | None = None
    stop: bool = False
    fixed: bool = True


@dataclass(frozen=True, slots=True)
class MotionSection:
    """Constraints from one waypoint to another, both included.

    With ``first == last`` the constraints hold at one waypoint. Sections may overlap; all their
    constraints hold.

    Attributes:
        first: Index of the first waypoint, from 0; negative indices count from the end.
        last: Index of the last waypoint, likewise.
        max_speed: Largest speed of the origin of B, in m/s.
        max_acceleration: Largest acceleration of the origin of B, in m/s^2.
        max_yaw_rate: Largest yaw rate, in rad/s; 0: the heading is constant.
        max_yaw_acceleration: Largest yaw acceleration, in rad/s^2.
        keep_in: Regions in which the robot stays.
        keep_out: Regions outside of which the robot stays.
        point_at: Point (x, y) in W at which the robot points, in m; None: none.
        point_tolerance: Largest deviation of the heading from the direction of that point, in rad.
        point_offset: Heading of the robot when it points at a point on the x axis of W, in rad; pi:
            its rear points at the point.
        lane: Largest distance of the origin of B from the line through the first and the last
            waypoint, in m.
    """

    first: int
    last: int
    max_speed: float = inf
    max_acceleration: float = inf
    max_yaw_rate: float = inf
    max_yaw_acceleration: float = inf
    keep_in: tuple[Region, ...] = ()
    keep_out: tuple[Region, ...] = ()
    point_at: tuple[float, float] | None = None
    point_tolerance: float = 0.05
    point_offset: float = 0.0
    lane: float = inf

    def limit_rows(self, number: int) -> tuple[LimitRows, ...]:
        """Return the finite limits of speeds and accelerations; ``number`` is in their names."""
        plane, yaw = np.eye(3)[:2], np.eye(3)[2:]
        groups = (
            (LimitRows("speed", "speed", plane, euclidean=True), self.max_speed),
            (LimitRows("yaw rate", "speed", yaw), self.max_yaw_rate),
            (
                LimitRows("acceleration", "acceleration", plane, euclidean=True),
                self.max_acceleration,
            ),
            (LimitRows("yaw acceleration", "acceleration", yaw), self.max_yaw_acceleration),
        )
        return tuple(
            group._replace(name=f"{group.name} of section {number}", rows=group.rows / limit)
            for group, limit in groups
            if isfinite(limit) and limit > 0.0  # with a yaw rate of 0 the path does not turn
        )
