"""Sensors and an estimator in series, as the closed loop calls them."""

from dataclasses import dataclass

from omnidrive.estimation import StateEstimator
from omnidrive.simulation import Sensors


@dataclass
class Perception:
    """Simulated sensors and a state estimator."""

    sensors: Sensors
    estimator: StateEstimator

    def reset(self, pose):
        self.sensors.reset(pose)
        self.estimator.reset(pose)

    def apply(self, faults):
        self.sensors.apply(faults)

    def update(self, t, state):
        return self.estimator.update(self.sensors.read(t, state))
