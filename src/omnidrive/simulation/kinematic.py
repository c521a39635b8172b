"""The kinematic plant: wheels execute their commanded speeds without slip."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.plant import PlantCapabilities, PlantState

_REST = BodyTwist(0.0, 0.0, 0.0)


@dataclass(slots=True)
class KinematicPlant:
    """Exact SE(2) motion within the wheel-speed limits; no mass, no slip.

    ``robot.drive`` converts the command to wheel speeds, ``robot.chassis`` converts these to
    motion; the two differ for a miscalibrated robot.
    """

    robot: Robot
    _pose: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False)

    @property
    def capabilities(self) -> PlantCapabilities:
        """Disturbable by pose offsets only: there are no forces."""
        return PlantCapabilities(disturbable=True)

    def reset(self, pose: Pose) -> PlantState:
        """Start at rest at ``pose``."""
        self._pose = pose
        return PlantState(pose, _REST, nan)

    def step(self, twist: BodyTwist, dt: float) -> PlantState:
        """Hold ``twist``, saturated in wheel space, for ``dt`` (s)."""
        drive = self.robot.drive
        actual = self.robot.chassis.twist(drive.wheel_speeds(drive.saturate(twist)))
        self._pose = move(self._pose, actual, dt)
        return PlantState(self._pose, actual, nan)

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
