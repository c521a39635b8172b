"""Factories of the state estimators of this package, which scenarios name, and their context."""

from __future__ import annotations

from dataclasses import dataclass

from omnidrive import estimation  # imports only the modules of the estimator in use
from omnidrive.estimation.estimator_settings import EstimatorSettings
from omnidrive.estimation.sensor_settings import SensorSettings
from omnidrive.estimation.state_estimator import StateEstimator
from omnidrive.robot import Robot


@dataclass(frozen=True, eq=False)
class EstimatorContext:
    """Context of a state estimator, an argument of its factory.

    Attributes:
        robot: Model of the robot.
        sensors: Its sensors.
        forces: Whether motors, masses and friction act, so that wheels may slip.
    """

    robot: Robot
    sensors: SensorSettings
    forces: bool = True


def kalman(context: EstimatorContext, parameters: EstimatorSettings) -> StateEstimator:
    """Kalman filter of wheel angles, gyro and pose fixes, with slip and late fixes."""
    return estimation.PoseEstimator(
        context.robot, context.sensors, parameters, slips=context.forces
    )


def latest_fix() -> StateEstimator:
    """Latest pose fix, without a filter."""
    return estimation.LatestFix()
