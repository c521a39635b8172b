"""Jumps of the estimated pose, by which a lost localisation is detected."""

from __future__ import annotations

from math import hypot

from omnidrive.estimation import State
from omnidrive.estimation.plausibility import RateLimits
from omnidrive.geometry import Pose
from omnidrive.robot import Robot

JUMP_DISTANCE, JUMP_ANGLE = 0.5, 0.5
"""Distance, m, and angle, rad, by which the estimated pose may change in addition to what the robot
can drive: more than a localisation corrects at once, less than an aisle is wide."""


class PoseJump:
    """Compares each estimated pose with the one before.

    Between two poses the robot moves by at most the time between their fixes times its largest
    rates (:class:`~omnidrive.estimation.plausibility.RateLimits`); what exceeds that by more than
    :data:`JUMP_DISTANCE` or :data:`JUMP_ANGLE` is a jump.

    Args:
        robot: The robot.
        dt: Sample time, s.
    """

    def __init__(self, robot: Robot, dt: float) -> None:
        vx, vy, self._yaw_rate = RateLimits.of(robot).twist.tolist()
        self._speed, self._dt = hypot(vx, vy), dt
        self._pose, self._fixed = Pose(0.0, 0.0, 0.0), 0.0

    def reset(self, pose: Pose) -> None:
        """Begin at ``pose``, which is known at the time 0."""
        self._pose, self._fixed = pose, 0.0

    def fault(self, state: State) -> str:
        """Return what jumped, in one line; empty: nothing. The state is the next one's base."""
        before, then = self._pose, self._fixed
        self._pose, self._fixed = state.pose, state.stamp - state.fix_age
        time = max(self._fixed - then, self._dt)
        distance = hypot(state.pose.x - before.x, state.pose.y - before.y)
        angle = abs(state.pose.yaw - before.yaw)
        if (
            distance <= self._speed * time + JUMP_DISTANCE
            and angle <= self._yaw_rate * time + JUMP_ANGLE
        ):
            return ""
        return f"the pose jumps by {distance:.2f} m and {angle:.2f} rad in {time:.2f} s"
