"""The kinematic plant: wheels execute their commanded speeds without slip."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan

from omnidrive.control.controller import STOP, CommandValue
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose, move
from omnidrive.robot import Chassis, Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.plant import (
    PlantCapabilities,
    PlantState,
    Saturation,
    check_robot,
    check_step,
)


@dataclass(slots=True)
class KinematicPlant:
    """Exact SE(2) motion within the wheel-speed limits; no mass, no slip.

    ``robot.drive`` converts a body twist to wheel speeds, ``robot.chassis`` converts these to
    motion; the two differ for a miscalibrated robot. Wheel speeds that no twist has in common
    (four wheels, three degrees of freedom) give the motion with the least squares of slip.
    """

    robot: Robot
    _pose: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False)
    _chassis: Chassis = field(init=False, repr=False)
    _drive: Chassis = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_robot(self.robot, "KinematicPlant")
        self._chassis, self._drive = self.robot.chassis, self.robot.drive

    @property
    def capabilities(self) -> PlantCapabilities:
        """Disturbable by pose offsets only: there are no forces, and it takes no torques."""
        return PlantCapabilities(disturbable=True, wheel_speeds=True)

    def reset(self, pose: Pose) -> PlantState:
        """Start at rest at ``pose``."""
        self._pose = pose
        return PlantState(pose, STOP, nan, wheel_speeds=(0.0,) * len(self.robot.mounts))

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Hold ``command``, saturated in wheel space, for ``dt`` (s).

        Raises:
            InvalidInput: It cannot, see :func:`~omnidrive.simulation.plant.check_step`.
        """
        check_step(command, dt, self.capabilities, len(self.robot.mounts))
        speeds, scaled = self._drive.limited_speeds(command)
        actual = self._chassis.twist(speeds)
        self._pose = move(self._pose, actual, dt)
        return PlantState(
            self._pose,
            actual,
            nan,
            wheel_speeds=tuple(speeds.tolist()),
            saturated=Saturation.WHEEL_SPEED if scaled else 0,
        )

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
        x, y, yaw = self._pose
        self._pose = Pose(x + offset.x, y + offset.y, yaw + offset.yaw)

    def close(self) -> None:
        """Do nothing: the plant holds no resources."""
