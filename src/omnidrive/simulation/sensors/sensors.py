"""The interface of simulated sensors, and sensors that measure the pose at every sample."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from math import nan, sin
from typing import Protocol, runtime_checkable

import numpy as np

from omnidrive.arrays import Array
from omnidrive.estimation import EncoderSettings, PoseFix, SensorReadings
from omnidrive.geometry import Pose
from omnidrive.simulation.disturbances.disturbances import SensorFaults
from omnidrive.simulation.plant import PlantState


@runtime_checkable
class Sensors(Protocol):
    """Simulated sensors of a robot: readings from the plant's true state."""

    def reset(self, pose: Pose) -> None:
        """Start a run at rest at ``pose`` without faults; random generators continue."""
        ...

    def apply(self, faults: SensorFaults) -> None:
        """Set the faults that hold from now on; ``reset`` removes them."""
        ...

    def read(self, t: float, state: PlantState) -> SensorReadings:
        """Return the readings at ``t`` (s) for the true ``state``; ``t`` must not decrease."""
        ...


@dataclass(slots=True)
class PerfectSensors:
    """An exact pose fix in every sample, wheel encoders and motor currents.

    Wheel angles and torques are empty for a plant that does not report them.

    Attributes:
        encoders: Resolution of the wheel encoders.
    """

    encoders: EncoderSettings = field(default_factory=EncoderSettings)
    _faults: SensorFaults = field(default=SensorFaults(), init=False, repr=False)

    def reset(self, pose: Pose) -> None:
        """Remove all faults."""
        self._faults = SensorFaults()

    def apply(self, faults: SensorFaults) -> None:
        """Set the faults that hold from now on."""
        self._faults = faults

    def read(self, t: float, state: PlantState) -> SensorReadings:
        """Return the readings at ``t`` (s); without a fix while fixes are silent."""
        fixes = () if self._faults.fixes_silent else (self._fix(t, state.pose),)
        angles = quantized(state.wheel_angles, self.encoders.step, self._faults.dead_encoders)
        return SensorReadings(t, angles, state.wheel_torques, None, fixes)

    def _fix(self, t: float, pose: Pose) -> PoseFix:
        return PoseFix(t, pose, 0.0, 0.0)


class PaperNoise(PerfectSensors):
    """Pose fixes with the paper's noise ``rand() / 6 * sin(t / 5)`` on x, y (m) and yaw (rad).

    ``rand`` is uniform in [0, 1], so the noise is biased: positive for the first 5 pi seconds. The
    fixes do not state their precision: their standard deviations are NaN.

    Args:
        rng: Generator of ``rand``; three numbers are drawn per fix, in the order x, y, yaw.
        encoders: Resolution of the wheel encoders.
    """

    def __init__(self, rng: np.random.Generator, encoders: EncoderSettings | None = None) -> None:
        super().__init__(encoders or EncoderSettings())
        self._rng = rng

    def _fix(self, t: float, pose: Pose) -> PoseFix:
        size = sin(t / 5.0) / 6.0
        dx, dy, dyaw = (self._rng.random(3) * size).tolist()
        return PoseFix(t, Pose(pose.x + dx, pose.y + dy, pose.yaw + dyaw), nan, nan)


def quantized(
    angles: Sequence[float], step: float, dead: Collection[int] = ()
) -> tuple[float, ...]:
    """Return angles (rad), rounded to multiples of ``step`` (rad); NaN for wheels in ``dead``."""
    counted = quantized_array(np.asarray(angles, dtype=float), step).tolist()
    return tuple(nan if i in dead else angle for i, angle in enumerate(counted))


def quantized_array(angles: Array, step: float) -> Array:
    """Return an array of angles (rad), rounded to multiples of ``step`` (rad)."""
    counted: Array = step * np.round(angles / step)
    return counted
