"""Where the robot is, from what its sensors tell."""

from omnidrive.simulation.estimation.estimator import EstimatorSettings, PoseEstimator
from omnidrive.simulation.estimation.sensor import EstimatingSensor

__all__ = ["EstimatingSensor", "EstimatorSettings", "PoseEstimator"]
