"""The kinematic plant: wheels execute their commanded speeds without slip; compiled."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import entry_point, inlined
from omnidrive.control.controller import CommandValue
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.geometry.kernels import move
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.plant import (
    PlantCapabilities,
    PlantState,
    Saturation,
    check_robot,
    check_step,
)


class KinematicModel(NamedTuple):
    """Parameters of the robot for the compiled functions."""

    drive: Float[Array, "wheels 3"]
    """Wheel speed per commanded body twist; rad/m, rad/m, rad/rad."""
    inverse: Float[Array, "3 wheels"]
    """Body twist per wheel speed: the pseudo-inverse of the wheel matrix; m/rad, m/rad, rad/rad."""
    max_wheel_speed: float
    """In rad/s."""


class KinematicState(NamedTuple):
    """Everything that the plant keeps from one command to the next."""

    pose: Float[Array, " 3"]
    """Pose of B in W; m, m, rad."""
    twist: Float[Array, " 3"]
    """Body twist; m/s, m/s, rad/s."""
    speeds: Float[Array, " wheels"]
    """Speed of each wheel, rad/s."""


@inlined
def roll(  # noqa: PLR0917
    drive: Float[Array, "wheels 3"],
    inverse: Float[Array, "3 wheels"],
    max_wheel_speed: float,
    pose: Float[Array, " 3"],
    twist: Float[Array, " 3"],
    speeds: Float[Array, " wheels"],
    dt: float,
) -> None:
    """Move for ``dt`` (s) with the wheel speeds in ``speeds``, in place.

    Args:
        drive: This and the following: fields of :class:`KinematicModel`.
        inverse: See there.
        max_wheel_speed: See there.
        pose: This and the following: fields of :class:`KinematicState`.
        twist: See there.
        speeds: See there.
        dt: Duration, s.
    """
    vx, vy, yaw_rate = 0.0, 0.0, 0.0
    for i in range(len(speeds)):
        vx += inverse[0, i] * speeds[i]
        vy += inverse[1, i] * speeds[i]
        yaw_rate += inverse[2, i] * speeds[i]
    moved = move(Pose(pose[0], pose[1], pose[2]), BodyTwist(vx, vy, yaw_rate), dt)
    pose[0], pose[1], pose[2] = moved.x, moved.y, moved.yaw
    twist[0], twist[1], twist[2] = vx, vy, yaw_rate


@inlined
def follow(  # noqa: PLR0917
    drive: Float[Array, "wheels 3"],
    inverse: Float[Array, "3 wheels"],
    max_wheel_speed: float,
    pose: Float[Array, " 3"],
    twist: Float[Array, " 3"],
    speeds: Float[Array, " wheels"],
    vx: float,
    vy: float,
    yaw_rate: float,
    dt: float,
) -> bool:
    """Execute a commanded body twist for ``dt`` (s), in place; return whether it was scaled down.

    Wheel speeds beyond the limit are scaled down together.

    Args:
        drive: This and the following: see :func:`roll`.
        inverse: See there.
        max_wheel_speed: See there.
        pose: See there.
        twist: See there.
        speeds: See there.
        vx: Commanded velocity along x of B, m/s.
        vy: Commanded velocity along y of B, m/s.
        yaw_rate: Commanded yaw rate, rad/s.
        dt: See there.
    """
    peak = 0.0
    for i in range(len(speeds)):
        speeds[i] = drive[i, 0] * vx + drive[i, 1] * vy + drive[i, 2] * yaw_rate
        peak = max(peak, abs(speeds[i]))
    scaled: bool = peak > max_wheel_speed
    if scaled:
        for i in range(len(speeds)):
            speeds[i] *= max_wheel_speed / peak
    roll(drive, inverse, max_wheel_speed, pose, twist, speeds, dt)
    return scaled


class KinematicPlant:
    """Exact SE(2) motion within the wheel-speed limits; no mass, no slip.

    ``robot.drive`` converts a body twist to wheel speeds, ``robot.chassis`` converts these to
    motion; the two differ for a miscalibrated robot. Wheel speeds that no twist has in common
    (four wheels, three degrees of freedom) give the motion with the least squares of slip.

    Attributes:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        """Create the model of the robot.

        Args:
            robot: The robot.

        Raises:
            InvalidInput: ``robot`` is not a robot.
        """
        check_robot(robot, "KinematicPlant")
        self.robot = robot
        self._model = KinematicModel(
            np.array(robot.drive.jacobian, dtype=float, order="C"),
            np.ascontiguousarray(np.linalg.pinv(robot.chassis.jacobian)),
            float(robot.drive.max_wheel_speed),
        )
        self._state = KinematicState(np.zeros(3), np.zeros(3), np.zeros(len(robot.mounts)))
        self._follow = entry_point(follow, *self._model, *self._state, 0.0, 0.0, 0.0, 0.1)

    @property
    def capabilities(self) -> PlantCapabilities:
        """Disturbable by pose offsets only: there are no forces, and it takes no torques."""
        return _CAPABILITIES

    def reset(self, pose: Pose) -> PlantState:
        """Start at rest at ``pose``."""
        self._state = KinematicState(
            np.array(pose, dtype=float), np.zeros(3), np.zeros(len(self._state.speeds))
        )
        return self._measure(scaled=False)

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Hold ``command``, saturated in wheel space, for ``dt`` (s).

        Raises:
            InvalidInput: It cannot, see :func:`~omnidrive.simulation.plant.check_step`.
        """
        check_step(command, dt, _CAPABILITIES, len(self.robot.mounts))
        if isinstance(command, BodyTwist):
            scaled = bool(self._follow(*self._model, *self._state, *command, dt))
            return self._measure(scaled=scaled)
        self._state.speeds[:], scaled = self.robot.drive.limited_speeds(command)
        roll(*self._model, *self._state, dt)
        return self._measure(scaled=scaled)

    def apply(self, disturbances: Disturbances) -> None:
        """Add a pose offset.

        Raises:
            InvalidInput: There are other disturbances, which need forces.
        """
        offset = disturbances.offset
        if disturbances != Disturbances(offset=offset):
            raise InvalidInput(
                "a plant without forces accepts no disturbance but a pose offset; use a plant with "
                "forces"
            )
        self._state.pose[:] += offset

    def close(self) -> None:
        """Do nothing: the plant holds no resources."""

    def _measure(self, *, scaled: bool) -> PlantState:
        return PlantState(
            Pose(*self._state.pose.tolist()),
            BodyTwist(*self._state.twist.tolist()),
            nan,
            wheel_speeds=tuple(self._state.speeds.tolist()),
            saturated=Saturation.WHEEL_SPEED if scaled else 0,
        )


_CAPABILITIES = PlantCapabilities(disturbable=True, wheel_speeds=True)
