"""The wheel monitor: finds wheels that no longer do what they are told."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from math import exp
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Robot


class WheelDefect(Enum):
    """What is wrong with a wheel."""

    DEAD = "is dead"
    """Its motor gives no torque; it turns freely."""
    LOCKED = "is locked"
    """It does not turn, and its motor strains."""
    BLIND = "has a dead encoder"
    """It is not seen to turn, but its motor does not strain."""


class Finding(NamedTuple):
    """A defect of a wheel."""

    wheel: int
    """Counted from 0."""
    defect: WheelDefect


SAMPLES = 3
"""In which a wheel must have contradicted itself before it is found defective."""

# of the motor's greatest torque
_NONE = 1e-3  # so little is no torque
_CALLED = 5e-3  # so much should have been given to tell a dead motor
_BRAKED = 0.05  # so much should have been given to tell a wheel that stands
_STANDS = 0.02  # part of the commanded speed below which a wheel stands
_MARGIN = 1.2  # on the grip of wheels
_TURNS = 0.1  # part above which it turns


class WheelMonitor:
    """Compares each motor's torque with what its servo should give at the speed that is measured.

    The mean torque of a velocity servo during a sample is, while it is not at its limit,
    ``gain (commanded - turned / dt)`` of the mean speeds; samples in which the command jumps so far
    that the limit is reached tell nothing of it. A healthy wheel keeps to that in every
    start and slide, as slip is between wheel and floor and not between motor and wheel:

    - a dead one turns with the floor, so not far from as told while the others have grip, and
      gives no torque where some is due;
    - a locked one stands where it should turn, and its motor strains;
    - one with a dead encoder seems to stand, but its motor does not strain.

    Each must show in three samples in which the wheel is called upon: 0.3 s at 0.1 s, or later
    where nothing is asked of it. In between, samples in which it does as it should acquit it.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._drive = robot.drive
        self._grip = _MARGIN * robot.force_limits * robot.wheel.radius / robot.max_torque
        self.reset()

    def reset(self) -> None:
        """Forget the past; all wheels are at rest, and deemed healthy."""
        wheels = len(self._robot.mounts)
        self._set_points = np.zeros(wheels)
        self._before = np.zeros(wheels)
        self._angles: Float[Array, " wheels"] | None = None
        self._signs = {defect: np.zeros(wheels, dtype=int) for defect in WheelDefect}
        self._known: set[int] = set()

    def watch(
        self, command: BodyTwist, dt: float, angles: Sequence[float], torques: Sequence[float]
    ) -> list[Finding]:
        """What the last sample reveals.

        Args:
            command: What was asked of the robot during it.
            dt: How long it was, in s.
            angles: How far each wheel has turned in all, by its encoder, in rad.
            torques: Mean torque of each motor during it, in N m.
        """
        wheels = len(self._robot.mounts)
        if len(angles) != wheels or len(torques) != wheels:
            return []
        now, before = np.asarray(angles, dtype=float), self._angles
        self._angles = now
        asked = self._asked(command, dt)
        if before is None:
            before = np.zeros(wheels)
        speeds, robot = (now - before) / dt, self._robot
        scale = robot.servo_gain / robot.max_torque
        due, given = scale * (asked - speeds), np.asarray(torques, dtype=float) / robot.max_torque
        linear = (scale * np.abs(asked - self._before) < 1.0) & (np.abs(due) < 1.0)
        self._before = asked
        stands = np.abs(speeds) <= _STANDS * np.abs(asked)
        strains = np.abs(given) >= 0.5 * np.minimum(np.abs(due), 1.0)
        called = scale * np.abs(asked) >= _BRAKED
        turns = np.abs(speeds) > _TURNS * np.abs(asked)
        none, rolls = np.abs(given) <= _NONE, np.abs(due) <= self._grip
        idle = linear & turns & none & rolls & (np.abs(due) >= _CALLED)
        evidence = {
            WheelDefect.DEAD: (idle, (np.abs(given) > 2.0 * _NONE) | ~rolls),
            WheelDefect.LOCKED: (stands & strains & called, ~stands & called),
            WheelDefect.BLIND: (stands & ~strains & called, ~stands & called),
        }
        return self._weigh(evidence)

    def _asked(self, command: BodyTwist, dt: float) -> Float[Array, " wheels"]:
        """Mean set points of the servos, which follow the command with the motors' lag."""
        told, lag = self._drive.wheel_speeds(self._drive.saturate(command)), self._robot.motor_lag
        if lag <= 0.0:
            return told
        behind, left = self._set_points - told, exp(-dt / lag)
        self._set_points = told + left * behind
        mean: Float[Array, " wheels"] = told + behind * (lag / dt) * (1.0 - left)
        return mean

    def _weigh(self, evidence: dict[WheelDefect, tuple[Array, Array]]) -> list[Finding]:
        """Count signs of each defect; what speaks against it takes them back."""
        found = []
        for defect, (sign, against) in evidence.items():
            count = self._signs[defect]
            count[against] = 0
            count[sign] += 1
            for wheel in np.flatnonzero(count >= SAMPLES).tolist():
                if wheel not in self._known:
                    self._known.add(wheel)
                    found.append(Finding(wheel, defect))
        return found
