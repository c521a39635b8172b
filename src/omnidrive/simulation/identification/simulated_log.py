"""Simulated logs for identification."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import Robot
from omnidrive.simulation.identification.robot_log import RobotLog
from omnidrive.simulation.plant import Plant

_SHARE = 0.08
"""Share of the largest acceleration that curves, and as much that steps, take along each axis."""
_LARGEST = np.array([0.8, 0.8, 1.5])  # m/s, m/s, rad/s
_HARD = 1.5  # m/s


def identification_commands(
    robot: Robot, rng: np.random.Generator, dt: float, duration: float
) -> Float[Array, "rows 3"]:
    """Return commands that determine all parameters: gentle curves, small steps and hard starts.

    The first three quarters are sums of sines and small random steps, for which the wheels need not
    slip; in the last quarter the robot starts at once in random directions and stops.

    Args:
        robot: The robot, with approximate parameters.
        rng: Generator of phases, steps and directions.
        dt: Sample time, s.
        duration: Duration, s.
    """
    rows = round(duration / dt)
    t = dt * np.arange(rows)
    lags = np.array([robot.lag[0], *robot.lag])
    changes = _SHARE / np.abs(robot.acceleration_faces).max(axis=0)
    smooth = changes * lags / (lags + dt)  # commands are constant within a sample
    wheels = np.abs(robot.chassis.jacobian).max(axis=0) / robot.max_wheel_speed
    largest = np.minimum(_LARGEST, 0.25 / wheels)
    commands = np.zeros((rows, 3))
    for axis in range(3):
        for _ in range(3):
            rate = rng.uniform(0.8, 1.6) * smooth[axis] / largest[axis]
            phase = rng.uniform(0.0, 2.0 * np.pi)
            commands[:, axis] += largest[axis] / 3.0 * np.sin(rate * t + phase)
    steps = np.repeat(rng.uniform(-1.0, 1.0, (rows // 10 + 1, 3)), 10, axis=0)[:rows]
    commands += steps * changes * lags
    ramp = 2.0 * largest / smooth  # s
    commands *= np.minimum(t[:, None] / ramp.max(), 1.0)
    hard = int(0.75 * rows)
    commands[hard:] = 0.0
    at = hard + round(1.0 / dt)
    while at + round(1.0 / dt) < rows:
        bearing = rng.uniform(0.0, 2.0 * np.pi)
        push = np.array([np.cos(bearing), np.sin(bearing), 0.0])
        wheel = float(np.abs(robot.chassis.jacobian @ push).max())
        commands[at : at + round(0.6 / dt)] = min(0.8 * robot.max_wheel_speed / wheel, _HARD) * push
        at += round(1.5 / dt)
    return commands


def simulated_log(
    plant: Plant,
    commands: Float[Array, "rows 3"],
    dt: float,
    rng: np.random.Generator,
    *,
    pose_noise: tuple[float, float] = (0.0, 0.0),
    wheel_noise: float = 0.0,
    delay: int = 0,
) -> RobotLog:
    """Return the log of a plant that executes commands from rest.

    Args:
        plant: The plant; if it does not report wheel speeds, the log holds none.
        commands: Commanded twist in every sample; m/s, m/s, rad/s.
        dt: Sample time, s.
        rng: Generator of the noise.
        pose_noise: Standard deviations of position (along each axis) and yaw; m, rad.
        wheel_noise: Standard deviation of the wheel speeds, rad/s.
        delay: Delay of the commands, in half samples.
    """
    state = plant.reset(Pose(0.0, 0.0, 0.0))
    half = 0.5 * dt
    queue = [np.zeros(3)] * delay
    poses, speeds = [state.pose], [state.wheel_speeds]
    for command in commands[:-1]:
        queue += [command, command]
        for _ in range(2):
            state = plant.step(BodyTwist(*queue.pop(0).tolist()), half)
        poses.append(state.pose)
        speeds.append(state.wheel_speeds)
    noise = rng.normal(size=(len(commands), 3)) * [pose_noise[0], *pose_noise]
    wheels = np.array(speeds) + wheel_noise * rng.normal(size=np.shape(speeds))
    return RobotLog(
        dt * np.arange(len(commands)),
        commands,
        np.array(poses) + noise,
        wheels if state.wheel_speeds else None,
    )
