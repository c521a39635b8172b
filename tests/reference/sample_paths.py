"""Paths, chassis and checks that the tests of timed references share."""

from math import pi

import numpy as np

from omnidrive.planning import SplinePath
from omnidrive.robot import Chassis

CROSS = [0.25 * pi, 0.75 * pi, 1.25 * pi, 1.75 * pi]

FOUR = Chassis.omni(angles=CROSS, ring_radius=0.3, wheel_radius=0.05, max_wheel_speed=30.0)
THREE = Chassis.omni(
    angles=[0.0, 2 * pi / 3, 4 * pi / 3], ring_radius=0.2, wheel_radius=0.04, max_wheel_speed=40.0
)
FIVE = Chassis.omni(
    angles=[0.1, 1.2, 2.9, 3.8, 5.2], ring_radius=0.4, wheel_radius=0.06, max_wheel_speed=25.0
)


def mecanum():
    """Rollers at 45 degrees, half track and half wheelbase 0.2 and 0.3 m."""
    rows = [[1, -1, -0.5], [1, 1, 0.5], [1, 1, -0.5], [1, -1, 0.5]]
    return Chassis(np.array(rows) / 0.05, 30.0)


CHASSIS = {"four": FOUR, "three": THREE, "five": FIVE, "mecanum": mecanum()}


def straight(length, angle=0.0, yaw=0.0, points=10):
    along = np.linspace(0.0, length, points)
    columns = [along * np.cos(angle), along * np.sin(angle), np.full(points, yaw)]
    return SplinePath(np.stack(columns, axis=1))


def turning(angle, points=8):
    """On the spot."""
    at = np.array([2.0, -1.0])
    return SplinePath(np.column_stack([np.tile(at, (points, 1)), np.linspace(0.0, angle, points)]))


def wandering(seed, points=12, step=0.4, turn=0.6):
    """A random walk whose heading wanders as well."""
    rng = np.random.default_rng(seed)
    direction = np.cumsum(rng.uniform(-turn, turn, points))
    steps = step * rng.uniform(0.5, 1.5, points)[:, None]
    xy = np.cumsum(steps * np.stack([np.cos(direction), np.sin(direction)], axis=1), axis=0)
    return SplinePath(np.column_stack([xy, np.cumsum(rng.uniform(-turn, turn, points))]))


def wheel_speeds(window, chassis):
    """Wheel speeds of a window's rows, in rad/s, without the package's own frame changes."""
    c, s = np.cos(window[:, 2]), np.sin(window[:, 2])
    vx, vy, turn = window[:, 3:].T
    return np.stack([c * vx + s * vy, -s * vx + c * vy, turn], axis=1) @ chassis.jacobian.T


def worst_shares(reference, chassis, acceleration, samples=20_001):
    """Peak shares of wheel speed and acceleration, by differences of what ``window`` gives.

    A mean acceleration over a step is at most the greatest in it, however long the step.
    """
    dt = reference.duration / (samples - 1)
    speeds = wheel_speeds(reference.window(0.0, samples, dt), chassis)
    change = np.abs(np.diff(speeds, axis=0)).max() / dt
    return np.abs(speeds).max() / chassis.max_wheel_speed, change / acceleration
