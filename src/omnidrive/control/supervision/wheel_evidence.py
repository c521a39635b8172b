"""Evidence of defects of wheels in samples with commanded speeds."""

from __future__ import annotations

from enum import Enum
from typing import TypeAlias

import numpy as np

from omnidrive.arrays import Array
from omnidrive.control.supervision.servo_response import ServoResponse
from omnidrive.robot import Robot


class WheelDefect(Enum):
    """Defects of a wheel."""

    DEAD = "is dead"
    """The motor produces no torque; the wheel turns freely."""
    LOCKED = "is locked"
    """The wheel does not turn although its motor produces torque."""
    DEAD_ENCODER = "has a dead encoder"
    """The encoder reports no rotation, but the torque is too small for a standing wheel."""


Signs: TypeAlias = dict[WheelDefect, tuple[Array, Array]]
"""Where samples speak for each defect, and where they speak against it."""

# torques as a share of the motor's largest
ZERO_TORQUE = 1e-3  # a torque up to this counts as zero
MIN_TORQUE_DEAD = 5e-3  # minimum expected torque for evidence of a dead motor
_MIN_TORQUE_STANDING = 0.05  # minimum expected torque for evidence from a standing wheel
# speeds as a share of the commanded one
_STANDING = 0.02  # a wheel up to this speed stands
_TURNING = 0.1  # a wheel above this speed turns
_MARGIN = 1.2  # factor on the torque that friction can transmit
_MIN_COUNTS = 3.0  # minimum commanded rotation per sample for evidence from a standing wheel
_STALLED = 0.9  # torque from which a standing wheel stalls, as a share of the motor's largest
_DOUBTFUL = 3.0  # factor on the error that the other wheels show


class WheelEvidence:
    """Evidence of defects, sample by sample, of one run or of many at once.

    All arrays may have dimensions of runs before that of the wheels.

    Args:
        robot: Wheel matrix, servo gain, lag and torque limit of the robot.
        step: Angle of an encoder count, rad.
        shape: Shape of the arrays of a sample.
    """

    def __init__(self, robot: Robot, step: float, shape: tuple[int, ...]) -> None:
        self._step, self._limit = step, robot.max_torque / robot.servo_gain
        self._transmitted = _MARGIN * robot.force_limits * robot.wheel.radius / robot.max_torque
        self._response = ServoResponse(robot.motor_lag, self._limit, shape)
        self._range = np.array([np.full(shape, np.inf), np.full(shape, -np.inf)])

    @property
    def lag(self) -> Array:
        """Motor lag that the robot shows, s."""
        return self._response.lag

    def restart(self, speeds: Array) -> None:
        """Continue from the present speeds, rad/s, after samples without commanded speeds."""
        self._response.restart(speeds)

    def update(self, target: Array, dt: float, speeds: Array, torque: Array) -> Signs:
        """Return the evidence of the next sample.

        There is evidence for a defect if the lag of the robot file and the one that the robot shows
        both give it. Further conditions:

        - Dead motor and dead encoder: the missing torque is larger than the other wheels' errors of
          the model.
        - Locked wheel: its torque is larger than what friction transmits, or has changed since the
          wheel stands. Otherwise the load, as on a slope, may equal the torque.

        Args:
            target: Commanded wheel speeds, rad/s.
            dt: Duration of the sample, s.
            speeds: Mean measured speeds, rad/s.
            torque: Mean torque of each motor as a share of its largest; NaN: unknown.
        """
        resolution = self._step / dt
        commanded, before = self._response.update(
            target, dt, speeds, torque * self._limit, resolution
        )
        signs = self.signs(commanded, before, speeds, torque, resolution)
        self._update_range(commanded, speeds, torque)
        if not any(sign.any() for sign, _ in signs.values()):
            return signs
        values, before, doubt = self._response.set_points()
        shown = self.signs(values, before, speeds, torque, resolution)
        missing = np.abs((values - speeds) / self._limit - torque)
        is_clear = missing >= _DOUBTFUL * doubt / self._limit
        conditions = {
            WheelDefect.DEAD: is_clear,
            WheelDefect.LOCKED: self._is_held(torque),
            WheelDefect.DEAD_ENCODER: is_clear,
        }
        return {
            defect: (sign & shown[defect][0] & conditions[defect], against)
            for defect, (sign, against) in signs.items()
        }

    def _update_range(self, commanded: Array, speeds: Array, torque: Array) -> None:
        """Update the range of the torque of each wheel since it stands."""
        turning = np.abs(speeds) > _STANDING * np.abs(commanded)
        minimum, largest = self._range
        np.fmin(minimum, torque, out=minimum)
        np.fmax(largest, torque, out=largest)
        minimum[turning], largest[turning] = np.inf, -np.inf

    def _is_held(self, torque: Array) -> Array:
        """Return whether standing wheels are held by more than the floor."""
        minimum, largest = self._range
        is_moved = largest - minimum > _MIN_TORQUE_STANDING
        is_strong = np.abs(torque) > np.minimum(self._transmitted, _STALLED)
        held: Array = is_strong | is_moved
        return held

    def signs(
        self, commanded: Array, before: Array, speeds: Array, torque: Array, resolution: float
    ) -> Signs:
        """Return the evidence of samples by one model of the set points.

        Args:
            commanded: Mean set point of each servo in the sample, rad/s.
            before: That in the sample before.
            speeds: Mean measured speed, rad/s.
            torque: Mean torque of each motor as a share of its largest; NaN: unknown.
            resolution: Smallest speed that the encoders resolve, rad/s.
        """
        scale = 1.0 / self._limit
        expected = scale * (commanded - speeds)
        linear = (scale * np.abs(commanded - before) < 1.0) & (np.abs(expected) < 1.0)
        is_standing = np.abs(speeds) <= _STANDING * np.abs(commanded)
        has_torque = np.abs(torque) >= 0.5 * np.minimum(np.abs(expected), 1.0)
        is_commanded = scale * np.abs(commanded) >= _MIN_TORQUE_STANDING
        is_commanded &= (np.abs(commanded) >= _MIN_COUNTS * resolution) & ~np.isnan(torque)
        is_turning = np.abs(speeds) > _TURNING * np.abs(commanded)
        is_zero = np.abs(torque) <= ZERO_TORQUE
        below_friction = np.abs(expected) <= self._transmitted
        torque_expected = np.abs(expected) >= MIN_TORQUE_DEAD + scale * resolution
        return {
            WheelDefect.DEAD: (
                linear & is_turning & is_zero & below_friction & torque_expected,
                (np.abs(torque) > 2.0 * ZERO_TORQUE) | ~below_friction,
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
