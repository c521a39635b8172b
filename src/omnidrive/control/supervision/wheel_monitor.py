"""The wheel monitor: detects dead motors, locked wheels and dead encoders."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from math import exp
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.estimation import EncoderSettings
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Robot


class WheelDefect(Enum):
    """Defects of a wheel."""

    DEAD = "is dead"
    """The motor gives no torque; the wheel turns freely."""
    LOCKED = "is locked"
    """The wheel does not turn although its motor gives torque."""
    DEAD_ENCODER = "has a dead encoder"
    """The encoder reports no rotation, and the motor gives no torque that would explain it."""


class Finding(NamedTuple):
    """A detected defect."""

    wheel: int
    """Index of the wheel, from 0."""
    defect: WheelDefect


SAMPLES = 3
"""Samples with evidence of a defect after which it is reported."""

# torques as a share of the motor's largest
_NONE = 1e-3  # a torque below this counts as none
_CALLED = 5e-3  # least expected torque for evidence of a dead motor
_BRAKED = 0.05  # least expected torque for evidence of a wheel that stands
# speeds as a share of the commanded one
_STANDS = 0.02  # a wheel at or below this stands
_TURNS = 0.1  # a wheel above this turns
_MARGIN = 1.2  # factor on the torque that friction can transmit
_COUNTS = 3.0  # least commanded rotation per sample, in encoder counts, for evidence of standing


class WheelMonitor:
    """Compares the torque of each motor with that of its velocity servo at the measured speed.

    The mean torque of a velocity servo during a sample is ``gain (commanded - turned / dt)`` of the
    mean speeds while it is below its limit; samples in which the command changes so much that the
    limit is reached are not evaluated. A healthy wheel satisfies that also when it slips, because
    slip occurs between wheel and floor, not between motor and wheel.

    - A dead motor: the wheel turns with the floor, near the commanded speed while the other wheels
      do not slip, and its torque is zero where the servo's is not.
    - A locked wheel: it stands where it should turn, and its motor gives torque.
    - A dead encoder: the wheel appears to stand, but its motor gives no torque.

    A defect is reported after three samples with evidence, that is after 0.3 s at 0.1 s or later if
    the wheel has little to do; a sample that contradicts the defect clears its count.

    Args:
        robot: Wheel matrix, servo gain, lag and torque limit of the robot.
        encoders: Resolution of the wheel encoders.
    """

    def __init__(self, robot: Robot, encoders: EncoderSettings | None = None) -> None:
        self._robot = robot
        self._drive = robot.drive
        self._step = (encoders or EncoderSettings()).step
        self._transmitted = _MARGIN * robot.force_limits * robot.wheel.radius / robot.max_torque
        self.reset()

    def reset(self) -> None:
        """Start a run: all wheels are at rest and healthy."""
        wheels = len(self._robot.mounts)
        self._set_points = np.zeros(wheels)
        self._before = np.zeros(wheels)
        self._angles = np.zeros(wheels)
        self._counts = {defect: np.zeros(wheels, dtype=int) for defect in WheelDefect}
        self._known: set[int] = set()

    def update(
        self, command: BodyTwist, dt: float, angles: Sequence[float], torques: Sequence[float]
    ) -> list[Finding]:
        """Defects found in the sample that has just ended.

        Args:
            command: Body twist commanded during the sample.
            dt: Duration of the sample, s.
            angles: Encoder angle of each wheel since the reset, rad; NaN is an encoder that
                reports nothing, which counts as no rotation.
            torques: Mean torque of each motor during the sample, N m.
        """
        wheels = len(self._robot.mounts)
        if len(angles) != wheels or len(torques) != wheels:
            return []
        now, before = np.asarray(angles, dtype=float), self._angles
        self._angles = now = np.where(np.isnan(now), before, now)
        commanded = self._mean_set_points(command, dt)
        speeds, robot, resolution = (now - before) / dt, self._robot, self._step / dt
        scale = robot.servo_gain / robot.max_torque
        expected = scale * (commanded - speeds)
        given = np.asarray(torques, dtype=float) / robot.max_torque
        linear = (scale * np.abs(commanded - self._before) < 1.0) & (np.abs(expected) < 1.0)
        self._before = commanded
        stands = np.abs(speeds) <= _STANDS * np.abs(commanded)
        strains = np.abs(given) >= 0.5 * np.minimum(np.abs(expected), 1.0)
        called = scale * np.abs(commanded) >= _BRAKED
        called &= np.abs(commanded) >= _COUNTS * resolution
        turns = np.abs(speeds) > _TURNS * np.abs(commanded)
        none, rolls = np.abs(given) <= _NONE, np.abs(expected) <= self._transmitted
        due = np.abs(expected) >= _CALLED + scale * resolution
        evidence = {
            WheelDefect.DEAD: (
                linear & turns & none & rolls & due,
                (np.abs(given) > 2.0 * _NONE) | ~rolls,
            ),
            WheelDefect.LOCKED: (stands & strains & called, ~stands & called),
            WheelDefect.DEAD_ENCODER: (stands & ~strains & called, ~stands & called),
        }
        return self._count(evidence)

    def _mean_set_points(self, command: BodyTwist, dt: float) -> Float[Array, " wheels"]:
        """Mean set points of the servos, rad/s, which follow the command with the motors' lag."""
        target, lag = self._drive.wheel_speeds(self._drive.saturate(command)), self._robot.motor_lag
        if lag <= 0.0:
            return target
        difference, decay = self._set_points - target, exp(-dt / lag)
        self._set_points = target + decay * difference
        mean: Float[Array, " wheels"] = target + difference * (lag / dt) * (1.0 - decay)
        return mean

    def _count(self, evidence: dict[WheelDefect, tuple[Array, Array]]) -> list[Finding]:
        """Count evidence for each defect; evidence against it clears the count."""
        found = []
        for defect, (sign, against) in evidence.items():
            count = self._counts[defect]
            count[against] = 0
            count[sign] += 1
            for wheel in np.flatnonzero(count >= SAMPLES).tolist():
                if wheel not in self._known:
                    self._known.add(wheel)
                    found.append(Finding(wheel, defect))
        return found
