"""Shared paths, chassis and checks of the tests of timed references."""

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
    """Return a chassis with rollers at 45 degrees, half track 0.2 m and half wheelbase 0.3 m."""
    rows = [[1, -1, -0.5], [1, 1, 0.5], [1, 1, -0.5], [1, -1, 0.5]]
    return Chassis(np.array(rows) / 0.05, 30.0)


CHASSIS = {"four": FOUR, "three": THREE, "five": FIVE, "mecanum": mecanum()}


def straight(length, angle=0.0, yaw=0.0, points=10):
    along = np.linspace(0.0, length, points)
    columns = [along * np.cos(angle), along * np.sin(angle), np.full(points, yaw)]
    return SplinePath(np.stack(columns, axis=1))


def turning(angle, points=8):
    """Return a turn on the spot."""
    at = np.array([2.0, -1.0])
    return SplinePath(np.column_stack([np.tile(at, (points, 1)), np.linspace(0.0, angle, points)]))


def wandering(seed, points=12, step=0.4, turn=0.6):
    """Return a random walk with random headings."""
    rng = np.random.default_rng(seed)
    direction = np.cumsum(rng.uniform(-turn, turn, points))
    steps = step * rng.uniform(0.5, 1.5, points)[:, None]
    xy = np.cumsum(steps * np.stack([np.cos(direction), np.sin(direction)], axis=1), axis=0)
    return SplinePath(np.column_stack([xy, np.cumsum(rng.uniform(-turn, turn, points))]))


def wheel_speeds(window, chassis):
    """Return wheel speeds of a window, in rad/s, independently of the package's transforms."""
    c, s = np.cos(window[:, 2]), np.sin(window[:, 2])
    vx, vy, turn = window[:, 3:].T
    return np.stack([c * vx + s * vy, -s * vx + c * vy, turn], axis=1) @ chassis.jacobian.T


def worst_shares(reference, chassis, acceleration, samples=20_001):
    """Return the peak usage of wheel speed and acceleration, by differences of ``window``.

    The mean acceleration over a step is at most the largest within the step.
    """
    dt = reference.duration / (samples - 1)
    speeds = wheel_speeds(reference.window(0.0, samples, dt), chassis)
    change = np.abs(np.diff(speeds, axis=0)).max() / dt
    return np.abs(speeds).max() / chassis.max_wheel_speed, change / acceleration
