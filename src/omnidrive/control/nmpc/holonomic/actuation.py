"""How a robot follows what is asked of it."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc.holonomic.grip import Grip
from omnidrive.control.nmpc.holonomic.limits import joined, rate_limits, speed_limits
from omnidrive.control.nmpc.holonomic.problem import Limits
from omnidrive.errors import InvalidInput
from omnidrive.robot import Chassis, Robot


@dataclass(frozen=True, eq=False, slots=True)
class Actuation:
    """What a plan takes into account of the robot besides the speed of its wheels.

    Attributes:
        acceleration: ``|acceleration @ (ax, ay, yaw acceleration)| <= 1`` in B; s^2/m, s^2/m and
            s^2/rad. What the wheels can push is
            :attr:`omnidrive.robot.Robot.acceleration_faces`; the unit matrix over
            limits is a limit of the body twist's acceleration, and the wheel matrix
            over a limit in rad/s^2 is one of the wheels'. None: no limit.
        lag: Time constants in s with which translation and rotation follow what is asked for; see
            :func:`omnidrive.simulation.identify_lag`.
        grip: How the wheels push, where they may slip; it stands in for ``lag`` in what is asked
            for, and ``lag`` for it in the plan. None: ``lag`` says all.
        delay: Time in s from a measurement until what is asked for thereupon begins to act.
    """

    acceleration: Float[Array, "rows 3"] | None = None
    lag: tuple[float, float] = (0.0, 0.0)
    grip: Grip | None = None
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (*(("lag", each) for each in self.lag), ("delay", self.delay)):
            if not (isfinite(value) and value >= 0.0):
                raise InvalidInput(f"the {name} must not be negative, got {value:g} s")

    @classmethod
    def of(
        cls, robot: Robot, traction: float = 0.85, *, may_spin: bool = True, delay: float = 0.0
    ) -> Actuation:
        """Of a robot whose plans accelerate by ``traction`` times what its wheels can push.

        Where its wheels must not spin, see :attr:`Grip.may_spin`, it loses some centimetres of
        odometry by a hard start, not decimetres, and follows less closely.

        Args:
            robot: With what :func:`omnidrive.simulation.identify_lag` finds for its lags.
            traction: Positive; 1 is all that its wheels push with equal loads.
            may_spin: Whether wheels may spin where the robot does not get along as planned.
            delay: In s; not negative.

        Raises:
            InvalidInput: An argument, or what the robot is like, is outside its domain.
        """
        if not 0.0 < traction < inf:
            raise InvalidInput(f"the traction must be positive, got {traction:g}")
        grip = Grip.of(robot, may_spin=may_spin)
        return cls(robot.acceleration_faces / traction, robot.lag, grip, delay)

    def limits(self, chassis: Chassis, dt: float) -> Limits:
        """Limits of the wheels' speeds and, where there is one, of acceleration."""
        speeds = speed_limits(chassis.jacobian, chassis.max_wheel_speed, dt, self.lag)
        if self.acceleration is None:
            return speeds
        return joined(speeds, rate_limits(self.acceleration, 1.0, dt))
