"""Error of the pose, predicted from commands by the drive model, or from wheels by the filter.

A figure eight of 20 s on the plant `planar`, without pose fixes, with drives that differ from the
model; see decision 0016. The command is the reference's twist and the error of the true pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import hypot

import numpy as np
from figures import publish, row

from omnidrive.estimation import PoseEstimator, SensorSettings
from omnidrive.geometry import BodyTwist, wrap
from omnidrive.reference import Eight, ShapeReference
from omnidrive.robot import Robot, named_robot
from omnidrive.simulation import PlanarPlant, SensorSuite

DT, DURATION = 0.05, 20.0  # s


def drives(robot: Robot) -> dict[str, Robot]:
    """Return the simulated robots; the model is that of ``robot``."""
    return {
        "as modelled": robot,
        "gain 0.95": replace(robot, drive_gain=(0.95, 0.95, 0.95)),
        "lag 0.1 s": replace(robot, motor_lag=0.1),
        "friction x 0.25": replace(robot, friction=0.25 * robot.friction),
    }


def mean_errors(robot: Robot, simulated: Robot) -> tuple[float, float]:
    """Return the mean position errors of the model and of the pose filter, mm."""
    reference, sensors = ShapeReference(Eight(), DURATION), SensorSettings(fixes=None)
    suite = SensorSuite(sensors, robot.chassis, np.random.default_rng(0))
    estimator = PoseEstimator(robot, sensors)
    plant, model = PlanarPlant(simulated), PlanarPlant(robot)
    start = reference.at(0.0).pose
    truth, predicted = plant.reset(start), model.reset(start)
    suite.reset(start)
    estimator.reset(start)
    estimator.update(suite.read(0.0, truth))
    errors = []
    for k in range(1, round(DURATION / DT) + 1):
        target, pose = reference.at(DT * (k - 1)), truth.pose
        u = target.twist[0] + target.pose.x - pose.x
        v = target.twist[1] + target.pose.y - pose.y
        c, s = np.cos(pose.yaw), np.sin(pose.yaw)
        turn = target.twist[2] + wrap(target.pose.yaw - pose.yaw)
        command = BodyTwist(c * u + s * v, c * v - s * u, turn)
        truth, predicted = plant.step(command, DT), model.step(command, DT)
        found = estimator.update(suite.read(DT * k, truth)).pose
        assert found is not None
        errors.append(
            [hypot(each.x - truth.pose.x, each.y - truth.pose.y)
             for each in (predicted.pose, found)]
        )  # fmt: skip
    of_model, of_filter = 1e3 * np.mean(errors, axis=0)
    return float(of_model), float(of_filter)


def rows() -> Iterator[dict[str, object]]:
    for name in ("paper", "small"):
        robot = named_robot(name)
        for drive, simulated in drives(robot).items():
            of_model, of_filter = mean_errors(robot, simulated)
            yield row(f"{name}, {drive}: from commands", of_model, "mm")
            yield row(f"{name}, {drive}: from wheels", of_filter, "mm")


if __name__ == "__main__":
    publish("dead_reckoning", list(rows()))
