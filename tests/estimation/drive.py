"""A robot without slip, with its sensors and its estimator."""

import numpy as np

from omnidrive.estimation import (
    EncoderSettings,
    EstimatorSettings,
    GyroSettings,
    PoseEstimator,
    PoseFixSettings,
    SensorSettings,
)
from omnidrive.estimation.pose_filter.filter_state import CORNERING, POSE
from omnidrive.geometry import BodyTwist, Pose, move, twist_between
from omnidrive.robot import named_robot
from omnidrive.simulation import PlantState, SensorSuite

ROBOT = named_robot("paper")
REST = BodyTwist(0.0, 0.0, 0.0)
START = Pose(1.0, -2.0, 0.5)
DT = 0.1
FINE = EncoderSettings(2**24)
QUIET = SensorSettings(
    FINE,
    GyroSettings(noise_density=1e-6, bias=0.0, bias_walk=0.0),
    PoseFixSettings(position_sigma=1e-4, yaw_sigma=1e-4),
)
MATCHED = SensorSettings(
    FINE,
    GyroSettings(noise_density=3e-3, bias=0.01, bias_walk=1e-3),
    PoseFixSettings(
        position_sigma=0.02, yaw_sigma=0.01, position_bias=0.05, yaw_bias=0.03, bias_damping=0.5
    ),
)
"""Sensors with large noise, which dominates all other errors."""
CREEP = 5e-3
NOISE_ONLY = EstimatorSettings(creep=CREEP, slip_doubt=0.0, false_alarms=1e-8, floor=1e-6)


def oscillating(t):
    """Return a body twist whose components oscillate."""
    return BodyTwist(0.5 * np.cos(0.4 * t), 0.3 * np.sin(0.7 * t), 0.4 * np.sin(0.3 * t))


def is_definite(covariance, tolerance=1e-9):
    """Return whether a covariance is finite and positive semidefinite, in any units."""
    sigmas = np.sqrt(np.diag(covariance))
    correlation = covariance / np.maximum(np.outer(sigmas, sigmas), 1e-300)
    return np.isfinite(covariance).all() and np.linalg.eigvalsh(correlation)[0] > -tolerance


class Drive:
    """A robot without slip whose rims creep, with its sensors, their readings and its estimator."""

    clock = 0.0  # offset of the clock of the sensors, s

    def __init__(
        self, sensors=QUIET, filter_settings=None, seed=0, creep=0.0, robot=ROBOT, start=START,
        dt=DT,
    ):  # fmt: skip
        rng = np.random.default_rng(seed)
        self.robot, self.creep, self.rng, self.dt = robot, creep, rng.spawn(1)[0], dt
        self.sensors = SensorSuite(sensors, robot.chassis, rng)
        self.estimator = PoseEstimator(robot, sensors, filter_settings, slips=False)
        self.sensors.reset(start)
        self.estimator.reset(start)
        self.log = []
        self.pose, self.angles, self.k = start, np.zeros(len(robot.mounts)), 0
        self.fix_bias = np.zeros((2, 3))
        self.state = self.sense()

    @property
    def t(self):
        return self.k * self.dt

    def sense(self):
        if self.sensors._fixes:
            self.fix_bias = self.sensors._fixes._bias.copy()  # of the fix at this sample
        state = PlantState(self.pose, REST, 0.0, tuple(self.angles.tolist()))
        self.log.append(self.sensors.read(self.t, state))
        readings, clock = self.log[-1], self.clock
        fixes = tuple(fix._replace(stamp=fix.stamp + clock) for fix in readings.fixes)
        return self.update(readings._replace(stamp=readings.stamp + clock, fixes=fixes))

    def update(self, readings):
        """Update the estimator; tests spoil the readings here."""
        return self.estimator.update(readings)

    def go(self, seconds, twist=oscillating):
        for _ in range(round(seconds / self.dt)):
            now = twist(self.t)
            displacements = self.robot.rim_jacobian @ np.array(now) * self.dt
            displacements += (
                self.creep
                * np.sqrt(np.abs(displacements))
                * self.rng.standard_normal(len(displacements))
            )
            self.pose = move(self.pose, now, self.dt)
            self.angles = self.angles + displacements / self.robot.wheel.radius
            self.k += 1
            self.state = self.sense()
        return self

    @property
    def error(self):
        return np.hypot(self.state.pose.x - self.pose.x, self.state.pose.y - self.pose.y)

    @property
    def filter_error(self):
        """True state minus its estimate, as the filter's covariance defines it; no cornering."""
        mean = self.estimator.filter_state.mean
        pose_error = twist_between(Pose(*mean[POSE].tolist()), self.pose, 1.0)
        biases = np.array([self.sensors._gyro.bias, *self.fix_bias.ravel()])
        return np.array([*pose_error, *(biases - mean[3:CORNERING])])
