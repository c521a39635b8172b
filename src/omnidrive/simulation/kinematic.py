"""The kinematic plant: wheels that turn as told and never slip."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.robot import Robot
from omnidrive.simulation.conditions import Conditions
from omnidrive.simulation.plant import Measurement

_REST = BodyTwist(0.0, 0.0, 0.0)


@dataclass(slots=True)
class KinematicPlant:
    """Exact SE(2) motion under the wheel-speed limits; no mass, no slip.

    The command becomes wheel speeds by ``robot.drive``, the wheel speeds become motion by
    ``robot.chassis``: the two differ on a miscalibrated robot.
    """

    robot: Robot
    _pose: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False)

    def reset(self, pose: Pose) -> Measurement:
        """Place the robot at ``pose``."""
        self._pose = pose
        return Measurement(pose, _REST, nan)

    def step(self, twist: BodyTwist, dt: float) -> Measurement:
        """Hold ``twist``, cut to the wheels' limits, for ``dt`` seconds."""
        drive = self.robot.drive
        actual = self.robot.chassis.twist(drive.wheel_speeds(drive.saturate(twist)))
        self._pose = move(self._pose, actual, dt)
        return Measurement(self._pose, actual, nan)

    def impose(self, conditions: Conditions) -> None:
        """Carry the robot elsewhere; nothing else can act on one without forces.

        Raises:
            InvalidInput: The conditions say anything else.
        """
        jump = conditions.jump
        if conditions != Conditions(jump=jump):
            raise InvalidInput(
                "on the plant kinematic, which knows no forces, only pose-jump, sensors and timing "
                "can go wrong; take the plant rollers, ball or planar"
            )
        x, y, yaw = self._pose
        self._pose = Pose(x + jump.vx, y + jump.vy, yaw + jump.yaw_rate)
