"""Wheel encoders."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.estimation import EncoderSettings
from omnidrive.geometry import Pose, twist_between
from omnidrive.robot import Chassis
from omnidrive.simulation.plant import PlantState
from omnidrive.simulation.sensors.sensors import quantized


@dataclass(slots=True)
class Encoders:
    """Wheel angles, rounded to whole counts.

    If the plant does not report wheel angles, they are computed from the true motion for wheels
    that roll without slip.

    Attributes:
        settings: Resolution of all encoders.
        chassis: True geometry of the robot.
    """

    settings: EncoderSettings
    chassis: Chassis
    _previous: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False, repr=False)
    _rolled: Float[Array, " wheels"] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.reset(self._previous)

    def reset(self, pose: Pose) -> None:
        """Set all angles to zero; the robot stands at ``pose``."""
        self._previous, self._rolled = pose, np.zeros(len(self.chassis.jacobian))

    def read(self, state: PlantState, dead: Collection[int] = ()) -> tuple[float, ...]:
        """Return the wheel angles, rad; NaN for the wheels in ``dead``."""
        self._rolled = self._rolled + self.chassis.wheel_speeds(
            twist_between(self._previous, state.pose, 1.0)
        )
        self._previous = state.pose
        angles = state.wheel_angles or tuple(self._rolled.tolist())
        return quantized(angles, self.settings.step, dead)
