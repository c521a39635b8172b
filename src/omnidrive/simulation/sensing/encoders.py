"""Encoders at the wheels."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from math import nan, pi
from typing import Annotated

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose, twist_between
from omnidrive.parameter import Bounds
from omnidrive.robot import Chassis
from omnidrive.simulation.plant import Measurement


@dataclass(frozen=True, slots=True)
class EncoderSettings:
    """Incremental encoders that never miss a count."""

    counts_per_turn: Annotated[int, Bounds(4, 2**24, "counts")] = 4096
    """Of the wheel, all edges counted: those of a usual encoder with 1024 lines at the wheel."""

    @property
    def step(self) -> float:
        """Angle from count to count, in rad."""
        return 2.0 * pi / self.counts_per_turn


@dataclass(slots=True)
class Encoders:
    """Angles of the wheels in whole counts.

    Of a plant that does not tell its wheels' angles, those of wheels that never slip.

    Attributes:
        settings: Of all wheels.
        chassis: The true one.
    """

    settings: EncoderSettings
    chassis: Chassis
    _pose: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False, repr=False)
    _rolled: Float[Array, " wheels"] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.reset(self._pose)

    def reset(self, pose: Pose) -> None:
        """Begin at zero; the robot stands at ``pose``."""
        self._pose, self._rolled = pose, np.zeros(len(self.chassis.jacobian))

    def read(self, state: Measurement, dead: Collection[int] = ()) -> tuple[float, ...]:
        """Angles in rad; NaN for wheels whose encoder is dead."""
        self._rolled = self._rolled + self.chassis.wheel_speeds(
            twist_between(self._pose, state.pose, 1.0)
        )
        self._pose = state.pose
        angles = np.asarray(state.wheel_angles) if state.wheel_angles else self._rolled
        counted = self.settings.step * np.round(angles / self.settings.step)
        return tuple(nan if i in dead else angle for i, angle in enumerate(counted.tolist()))
