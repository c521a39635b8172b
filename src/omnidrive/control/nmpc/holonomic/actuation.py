"""Response of the robot to commanded twists: acceleration limits, lag, slip and delay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, isfinite

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc.holonomic.limits import rate_limits, speed_limits, stack_limits
from omnidrive.control.nmpc.holonomic.problem import Limits
from omnidrive.control.reduced_drive import ReducedDrive
from omnidrive.errors import InvalidInput
from omnidrive.estimation.drive_estimate import DriveEstimate
from omnidrive.robot import Chassis, Robot, force_share
from omnidrive.robot.drive_model import DriveModel


@dataclass(frozen=True, eq=False, slots=True)
class Actuation:
    """Model of the robot's response, besides its wheel speed limit.

    Attributes:
        acceleration_faces: Rows of ``|acceleration_faces @ (ax, ay, yaw acceleration)| <= 1`` in B;
            s^2/m, s^2/m and s^2/rad. The limits of the wheels' forces are
            :attr:`omnidrive.robot.Robot.acceleration_faces`; the identity divided by limits is a
            limit of the body twist's acceleration; the wheel matrix divided by a limit in rad/s^2
            is a limit of the wheels' acceleration. None: no limit.
        lag: Time constants in s of translation and of rotation, with which the body twist follows
            the commanded twist; see :func:`omnidrive.simulation.identify_lag`.
        slip_model: Model of wheel slip, with which the commanded twist is computed; the plan uses
            ``lag``. None: ``lag`` is used for both.
        delay: Time in s from a measurement until the resulting command takes effect.
        drive_gain: Ratio of the steady body twist to the commanded one along x, y and yaw of B.
        motor_lag: Time constant in s with which the motors follow the command, in addition to that
            of ``slip_model``.
        traction: Share of the wheels' friction that ``acceleration_faces`` uses.
        may_spin: Whether wheels may spin where the robot cannot follow the plan.

    Raises:
        InvalidInput: A lag or the delay is negative or not finite.
    """

    acceleration_faces: Float[Array, "rows 3"] | None = None
    lag: tuple[float, float] = (0.0, 0.0)
    slip_model: DriveModel | None = None
    delay: float = 0.0
    traction: float = 1.0
    drive_gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    motor_lag: float = 0.0
    may_spin: bool = True

    def __post_init__(self) -> None:
        lags = (("lag", self.lag[0]), ("lag", self.lag[1]), ("motor lag", self.motor_lag))
        for name, value in (*lags, ("delay", self.delay)):
            if not (isfinite(value) and value >= 0.0):
                raise InvalidInput(f"the {name} must not be negative, got {value:g} s")

    @classmethod
    def of(
        cls,
        robot: Robot,
        traction: float = force_share.PLANS,
        *,
        may_spin: bool = True,
        delay: float = 0.0,
    ) -> Actuation:
        """Return the model of a robot whose plans use a share of the wheels' friction.

        Without spinning wheels, see :func:`~.slip_compensation.compensate`, a start at full
        acceleration costs centimetres of odometry instead of decimetres, but the tracking error is
        larger.

        Args:
            robot: With the lags that :func:`omnidrive.simulation.identify_lag` finds.
            traction: Positive; 1 is the full friction limit of the wheels at equal loads.
            may_spin: Whether wheels may spin where the robot cannot follow the plan.
            delay: In s; not negative.

        Raises:
            InvalidInput: An argument, or a property of the robot, is outside its domain.
        """
        if not 0.0 < traction < inf:
            raise InvalidInput(f"the traction must be positive, got {traction:g}")
        slip_model = DriveModel.of(robot)
        return cls(
            robot.acceleration_faces / traction,
            robot.lag,
            slip_model,
            delay,
            traction,
            robot.drive_gain,
            robot.motor_lag,
            may_spin,
        )

    def with_reduced_drive(self, drive: ReducedDrive) -> Actuation:
        """Return the response of the same robot with the wheels that still drive."""
        faces, slip_model = self.acceleration_faces, self.slip_model
        if faces is not None:
            faces = drive.acceleration_faces / self.traction
        if slip_model is not None:
            slip_model = slip_model._replace(
                rim_jacobian=np.ascontiguousarray(drive.rim_jacobian),
                max_force=drive.force_ratio * slip_model.max_force,
            )
        return replace(self, acceleration_faces=faces, slip_model=slip_model)

    @property
    def drive(self) -> DriveEstimate:
        """Gains, lag and delay of the drive, before any is identified in a run."""
        return DriveEstimate(self.drive_gain, self.motor_lag, self.delay, self.motor_lag)

    @property
    def reserve(self) -> float:
        """Full friction of the wheels over the share that plans use, at least 1."""
        return max(1.0, 1.0 / self.traction)

    def limits(self, chassis: Chassis, dt: float, acceleration: float = 1.0) -> Limits:
        """Return the limits of wheel speeds and, if there are any, of accelerations.

        Args:
            chassis: The wheels and their maximum speed.
            dt: Length of a stage, in s.
            acceleration: Factor of the limits of accelerations.
        """
        speeds = speed_limits(chassis.jacobian, chassis.max_wheel_speed, dt, self.lag)
        if self.acceleration_faces is None:
            return speeds
        rates = rate_limits(self.acceleration_faces, acceleration, dt)
        limits = stack_limits(speeds, rates)
        return limits._replace(inertial=self.slip_model is not None)
