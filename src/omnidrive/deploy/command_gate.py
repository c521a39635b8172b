"""Last check of commands before they are sent to a robot."""

from __future__ import annotations

from omnidrive.control import CommandValue, WheelSpeeds, WheelTorques
from omnidrive.control.controller import STOP
from omnidrive.geometry import BodyTwist
from omnidrive.parameter import are_finite
from omnidrive.robot import Robot

RAMP_TIME = 0.5
"""Time in which the last twist decreases to zero when the robot is held, s."""


class CommandGate:
    """Limits of what leaves the computer: finite numbers, within the robot's limits.

    Attributes:
        limited: Number of commands that were scaled down to the limits.
        sent: The last command that passed.
    """

    def __init__(self, robot: Robot) -> None:
        """Take the limits of the wheels from ``robot``."""
        self._robot = robot
        self._jacobian = [tuple(row) for row in robot.chassis.jacobian.tolist()]
        self.limited = 0
        self.sent: CommandValue = STOP
        self._held: BodyTwist = STOP
        self._share = 0.0

    def passed(self, value: CommandValue) -> CommandValue | None:
        """Return the command to send: scaled down in direction if a wheel exceeds its limit.

        None: a number is not finite; nothing may be sent.
        """
        if not are_finite(value):
            return None
        limited = self._limited(value)
        self.limited += limited is not value
        self.sent = limited
        return limited

    def _limited(self, value: CommandValue) -> CommandValue:
        torques = isinstance(value, WheelTorques)
        limit = self._robot.max_torque if torques else self._robot.max_wheel_speed
        if isinstance(value, BodyTwist):
            vx, vy, yaw_rate = value
            wheels = [x * vx + y * vy + z * yaw_rate for x, y, z in self._jacobian]
        else:
            wheels = list(value)
        largest = max(map(abs, wheels))
        if largest <= limit * (1.0 + 1e-9):
            return value
        numbers = [limit / largest * number for number in value]
        return BodyTwist(*numbers) if isinstance(value, BodyTwist) else type(value)(numbers)

    def hold(self) -> None:
        """Begin the ramp from the last command to zero; torques end at once."""
        if isinstance(self.sent, WheelSpeeds):
            self._held = self._robot.chassis.twist(self.sent)
        else:
            self._held = self.sent if isinstance(self.sent, BodyTwist) else STOP
        self._share = 1.0

    def ramp(self, dt: float) -> BodyTwist:
        """Return the next twist of the ramp; ``dt``: time since the last one, s."""
        share = self._share - dt / RAMP_TIME
        self._share = share if share > 1e-9 else 0.0
        twist = BodyTwist(*(self._share * each for each in self._held)) if self._share else STOP
        self.sent = twist
        return twist
