"""A sensor that thinks."""

from __future__ import annotations

from dataclasses import dataclass

from omnidrive.geometry import Pose
from omnidrive.simulation.conditions import SensorConditions
from omnidrive.simulation.estimation.estimator import PoseEstimator
from omnidrive.simulation.plant import Measurement
from omnidrive.simulation.sensing import Estimate, Sensors


@dataclass(frozen=True, slots=True)
class EstimatingSensor:
    """What the controller sees is what an estimator makes of the readings.

    Attributes:
        sensors: What there is to read.
        estimator: What makes a pose of it.
    """

    sensors: Sensors
    estimator: PoseEstimator

    def reset(self, pose: Pose) -> None:
        """The robot stands at ``pose``, and that is known."""
        self.sensors.reset(pose)
        self.estimator.reset(pose)

    def impose(self, conditions: SensorConditions) -> None:
        """Let ``conditions`` hold for the sensors; see :meth:`Sensors.impose`."""
        self.sensors.impose(conditions)

    def sense(self, t: float, state: Measurement) -> Estimate:
        """What the estimator believes at ``t`` (s) after reading all sensors."""
        return self.estimator.update(self.sensors.read(t, state))
