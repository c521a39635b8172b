"""Wheel monitor: detection of dead motors, locked wheels and dead encoders."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from math import exp
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.control.controller import CommandValue, WheelSpeeds, WheelTorques
from omnidrive.estimation import EncoderSettings
from omnidrive.estimation.state import LARGEST
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Robot


class WheelDefect(Enum):
    """Defects of a wheel."""

    DEAD = "is dead"
    """The motor produces no torque; the wheel turns freely."""
    LOCKED = "is locked"
    """The wheel does not turn although its motor produces torque."""
    DEAD_ENCODER = "has a dead encoder"
    """The encoder reports no rotation, but the torque is too small for a standing wheel."""


class Finding(NamedTuple):
    """A detected defect."""

    wheel: int
    """Index of the wheel, from 0."""
    defect: WheelDefect


SAMPLES = 3
"""Samples with evidence of a defect after which it is reported."""

# torques as a share of the motor's largest
_ZERO_TORQUE = 1e-3  # a torque up to this counts as zero
_MIN_TORQUE_DEAD = 5e-3  # minimum expected torque for evidence of a dead motor
_MIN_TORQUE_STANDING = 0.05  # minimum expected torque for evidence from a standing wheel
# speeds as a share of the commanded one
_STANDING = 0.02  # a wheel up to this speed stands
_TURNING = 0.1  # a wheel above this speed turns
_MARGIN = 1.2  # factor on the torque that friction can transmit
_SLOW = 0.9  # share of the largest wheel speed up to which a commanded torque is evaluated
_MIN_COUNTS = 3.0  # minimum commanded rotation per sample for evidence from a standing wheel


class WheelMonitor:
    """Compares the torque of each motor with that of its velocity servo at the measured speed.

    The mean torque of a velocity servo during a sample is ``gain (commanded - turned / dt)`` of the
    mean speeds while it is below its limit; samples in which the command changes so much that the
    limit is reached are not evaluated. A healthy wheel satisfies that also when it slips, because
    slip occurs between wheel and floor, not between motor and wheel.

    - Dead motor: the wheel turns with the floor, near the commanded speed while the other wheels do
      not slip; its torque is zero although that of the servo model is not.
    - Locked wheel: the wheel does not turn although it is commanded to, and its motor produces
      torque.
    - Dead encoder: the measured speed is zero although the wheel is commanded to turn, and the
      torque is too small for a standing wheel.

    While torques are commanded, only dead motors are detected: their torque is zero although the
    commanded one is not.

    A defect is reported after three samples with evidence: after 0.3 s at a sample time of 0.1 s,
    or later if the expected torque is small. A sample that contradicts the defect clears its
    count.

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
        self,
        command: CommandValue,
        dt: float,
        angles: Sequence[float],
        torques: Sequence[float],
    ) -> list[Finding]:
        """Return the defects found in the sample that has just ended.

        Args:
            command: Command during the sample.
            dt: Duration of the sample, s.
            angles: Encoder angle of each wheel since the reset, rad; NaN if an encoder
                reports nothing, which counts as no rotation, as does an infinite or huge angle.
            torques: Mean torque of each motor during the sample, N m; no evidence if it is NaN,
                infinite or huge.
        """
        wheels = len(self._robot.mounts)
        if len(angles) != wheels or len(torques) != wheels:
            return []
        before = self._angles
        self._angles = now = _usable(angles, before)
        speeds, robot, resolution = (now - before) / dt, self._robot, self._step / dt
        if isinstance(command, WheelTorques):
            return self._count(self._torque_evidence(command, speeds, _usable(torques, np.nan)))
        commanded = self._mean_set_points(command, dt)
        torque = _usable(torques, np.nan) / robot.max_torque
        evidence = self.evidence(commanded, self._before, speeds, torque, resolution)
        self._before = commanded
        return self._count(evidence)

    def evidence(
        self, commanded: Array, before: Array, speeds: Array, torque: Array, resolution: float
    ) -> dict[WheelDefect, tuple[Array, Array]]:
        """Return where samples with commanded speeds speak for each defect, and against it.

        The last dimension of all arrays is that of the wheels; others may be runs and samples.

        Args:
            commanded: Mean set point of each servo in the sample, rad/s.
            before: That in the sample before.
            speeds: Mean measured speed, rad/s.
            torque: Mean torque of each motor as a share of its largest; NaN: unknown.
            resolution: Smallest speed that the encoders resolve, rad/s.
        """
        scale = self._robot.servo_gain / self._robot.max_torque
        expected = scale * (commanded - speeds)
        linear = (scale * np.abs(commanded - before) < 1.0) & (np.abs(expected) < 1.0)
        is_standing = np.abs(speeds) <= _STANDING * np.abs(commanded)
        has_torque = np.abs(torque) >= 0.5 * np.minimum(np.abs(expected), 1.0)
        is_commanded = scale * np.abs(commanded) >= _MIN_TORQUE_STANDING
        is_commanded &= (np.abs(commanded) >= _MIN_COUNTS * resolution) & ~np.isnan(torque)
        is_turning = np.abs(speeds) > _TURNING * np.abs(commanded)
        is_zero = np.abs(torque) <= _ZERO_TORQUE
        below_friction = np.abs(expected) <= self._transmitted
        torque_expected = np.abs(expected) >= _MIN_TORQUE_DEAD + scale * resolution
        return {
            WheelDefect.DEAD: (
                linear & is_turning & is_zero & below_friction & torque_expected,
                (np.abs(torque) > 2.0 * _ZERO_TORQUE) | ~below_friction,
            ),
            WheelDefect.LOCKED: (
                is_standing & has_torque & is_commanded,
                ~is_standing & is_commanded,
            ),
            WheelDefect.DEAD_ENCODER: (
                is_standing & ~has_torque & is_commanded,
                ~is_standing & is_commanded,
            ),
        }

    def may_report(
        self,
        twists: Float[Array, "runs samples 3"],
        dt: float,
        angles: Float[Array, "runs samples wheels"],
        torques: Float[Array, "runs samples wheels"],
    ) -> Bool[Array, " runs"]:
        """Return whether ``update`` may report a defect in whole runs from rest; otherwise not.

        Args:
            twists: Twist commanded from each sample on; the last one is not used.
            dt: Duration of every sample, s.
            angles: Angles of the encoders at each sample, rad.
            torques: Mean torques of the motors in the sample that ends there, N m.
        """
        usable = (np.abs(angles) <= LARGEST) & (np.abs(torques) <= LARGEST)
        commanded = self._drive.limited_speeds_of(twists[:, :-1])
        lag = self._robot.motor_lag
        if lag > 0.0:
            set_point, decay = np.zeros_like(commanded[:, 0]), exp(-dt / lag)
            for k in range(commanded.shape[1]):
                target = commanded[:, k].copy()
                difference = set_point - target
                set_point = target + decay * difference
                commanded[:, k] = target + difference * (lag / dt) * (1.0 - decay)
        before = np.concatenate([np.zeros_like(commanded[:, :1]), commanded[:, :-1]], axis=1)
        speeds = np.diff(angles, axis=1) / dt
        torque = torques[:, 1:] / self._robot.max_torque
        signs = self.evidence(commanded, before, speeds, torque, self._step / dt).values()
        often = [(sign.sum(axis=1) >= SAMPLES).any(axis=1) for sign, _ in signs]
        reported: Bool[Array, " runs"] = np.any(often, axis=0) | ~usable.all(axis=(1, 2))
        return reported

    def _torque_evidence(
        self,
        command: WheelTorques,
        speeds: Float[Array, " wheels"],
        torques: Float[Array, " wheels"],
    ) -> dict[WheelDefect, tuple[Array, Array]]:
        """Return the evidence of a sample with commanded torques: that for a dead motor only.

        A motor at the largest wheel speed gives no torque, and is not evaluated.
        """
        robot, none = self._robot, np.zeros(len(speeds), dtype=bool)
        self._before = self._set_points = speeds  # where servos start that are commanded next
        expected, torque = (np.abs(values) / robot.max_torque for values in (command, torques))
        is_slow = np.abs(speeds) < _SLOW * robot.max_wheel_speed
        dead = is_slow & (expected >= _MIN_TORQUE_DEAD) & (torque <= _ZERO_TORQUE)
        evidence = dict.fromkeys(WheelDefect, (none, none))
        return evidence | {WheelDefect.DEAD: (dead, torque > 2.0 * _ZERO_TORQUE)}

    def _mean_set_points(
        self, command: BodyTwist | WheelSpeeds, dt: float
    ) -> Float[Array, " wheels"]:
        """Return the mean set points of the servos, rad/s, which follow the command with a lag."""
        lag = self._robot.motor_lag
        target, _ = self._drive.limited_speeds(command)
        if lag <= 0.0:
            return target
        difference, decay = self._set_points - target, exp(-dt / lag)
        self._set_points = target + decay * difference
        mean: Float[Array, " wheels"] = target + difference * (lag / dt) * (1.0 - decay)
        return mean

    def _count(self, evidence: dict[WheelDefect, tuple[Array, Array]]) -> list[Finding]:
        """Count the evidence for each defect and return the new findings."""
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


def _usable(
    numbers: Sequence[float], otherwise: Float[Array, " wheels"] | float
) -> Float[Array, " wheels"]:
    """Return the numbers; ``otherwise`` in place of those that are NaN, infinite or huge."""
    values = np.asarray(numbers, dtype=float)
    return np.where(np.abs(values) <= LARGEST, values, otherwise)
