"""References of the gauntlet, timed so that every robot can meet them in every case."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import inf, pi
from typing import NamedTuple

import numpy as np
from gauntlet_cases import CASES

from omnidrive.geometry import Pose, wrap
from omnidrive.reference import (
    Hold,
    MotionLimits,
    ShapeReference,
    limit_rows,
    shortest_duration_within,
)
from omnidrive.reference.shapes import Circle, Eight, RaisedCosine, RandomSmooth, Shape, Square
from omnidrive.reference.timing.piecewise_path import PathDerivatives, PiecewisePath
from omnidrive.reference.timing.reachability import max_squared_speeds
from omnidrive.reference.timing.time_parameterization import interval_rows
from omnidrive.robot import ROBOTS, Robot

SHARE = 0.7
"""Largest use of the wheel speed and of the forces of the robot, in every case."""
MIN_DURATION = 12.0  # s
SETTLED, ENDED = 3.0, 2.0
"""Errors count from 3 s on; those of a reference that stops at once, until 2 s before its end."""
STEP_DURATION = 5.0  # s
IMPOSSIBLE_DURATION = 8.0  # s, of the eight that the wheels cannot follow in time
ARRIVED = 0.05  # m from the end of the path
TRACTION = 0.85  # share of the forces that any controller can use at unequal loads, about


@dataclass(frozen=True, kw_only=True)
class SpinningEight(Eight):
    """Figure of eight on which the robot turns twice, independent of the direction of travel."""

    turns: float = 2.0

    def evaluate(self, s) -> PathDerivatives:
        poses, first, second = Eight(length=self.length, width=self.width).evaluate(s)
        poses[:, 2], first[:, 2], second[:, 2] = 2.0 * pi * self.turns * s, 2.0 * pi * self.turns, 0
        return PathDerivatives(poses, first, second)


@dataclass(frozen=True, kw_only=True)
class Lissajous(Shape):
    """Lissajous curve of 3:2 in x and y; the heading swings once."""

    def evaluate(self, s) -> PathDerivatives:
        def sines(amplitude, laps, phase=0.0):
            rate = 2.0 * pi * laps
            sine, cosine = np.sin(rate * s + phase), np.cos(rate * s + phase)
            return amplitude * np.stack([sine - np.sin(phase), rate * cosine, -(rate**2) * sine])

        return PathDerivatives(*np.stack([sines(1.5, 3), sines(1.0, 2, 0.5), sines(0.5, 1)], 2))


@dataclass(frozen=True, kw_only=True)
class Spiral(Shape):
    """Archimedean spiral outwards; the heading turns uniformly, independent of the direction."""

    radius: float = 2.0  # m, at the end
    laps: float = 2.0
    turn: float = pi  # rad

    def evaluate(self, s) -> PathDerivatives:
        rate = 2j * pi * self.laps
        rotation = self.radius * np.exp(rate * s)
        parts = np.zeros((3, len(s), 3))
        points = s * rotation, (1.0 + rate * s) * rotation, (2.0 + rate * s) * rate * rotation
        for part, point in zip(parts, points, strict=True):
            part[:, 0], part[:, 1] = point.real, point.imag
        parts[0, :, 2], parts[1, :, 2] = self.turn * s, self.turn
        return PathDerivatives(*parts)


@dataclass(frozen=True, kw_only=True)
class LaneChange(Shape):
    """Straight motion along x with a shift along y between 0.3 and 0.7 of the length."""

    length: float = 6.0  # m
    shift: float = 1.5  # m

    def evaluate(self, s) -> PathDerivatives:
        u, rate = np.clip((s - 0.3) / 0.4, 0.0, 1.0), 1.0 / 0.4
        parts = np.zeros((3, len(s), 3))
        parts[0, :, 0], parts[1, :, 0] = self.length * s, self.length
        parts[0, :, 1] = self.shift * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        parts[1, :, 1] = self.shift * rate * 30.0 * u * u * (1.0 - u) ** 2
        parts[2, :, 1] = self.shift * rate**2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
        return PathDerivatives(*parts)


@dataclass(frozen=True, kw_only=True)
class StopAndGo(Shape):
    """Straight motion along x with turning heading and three stops on the way."""

    length: float = 4.0  # m
    turn: float = 0.8  # rad

    def evaluate(self, s) -> PathDerivatives:
        rate = 2.0 * pi * 4.0
        share = s - np.sin(rate * s) / rate, 1.0 - np.cos(rate * s), rate * np.sin(rate * s)
        size = np.array([self.length, 0.0, self.turn])
        return PathDerivatives(*np.stack(share)[:, :, None] * size)


SHAPES: dict[str, Shape] = {
    "eight": Eight(),
    "eight-spin": SpinningEight(),
    "square": Square(ramp=0.0),
    "raised-cosine": RaisedCosine(),
    "circle": Circle(laps=2),
    "random": RandomSmooth(seed=18),
}
LINK_SHAPES: dict[str, tuple[Shape, float]] = {
    "lissajous": (Lissajous(), 12.0),
    "spiral-fast": (Spiral(), 10.0),
    "spiral-slow": (Spiral(radius=0.5, laps=1.0, turn=0.5), 20.0),
    "lane-change": (LaneChange(), 8.0),
    "stop-and-go": (StopAndGo(), 14.0),
    "eight-spin-fast": (SpinningEight(), 12.0),
    "random-fast": (RandomSmooth(seed=7), 12.0),
    "square-fast": (Square(ramp=0.1), 14.0),
}
"""Shapes and their least durations in s: at :data:`SHARE` of the limits of the nominal robot only,
so that floors with little friction limit the motion."""
STEPS: dict[str, Pose] = {
    "step-x": Pose(1.0, 0.0, 0.0),
    "step-y": Pose(0.0, 1.0, 0.0),
    "step-heading": Pose(0.0, 0.0, 0.25 * pi),
    "step-all": Pose(1.0, 1.0, 0.25 * pi),
}
IMPOSSIBLE = "eight-8s"


def limits_of(robot: Robot, share: float):
    return limit_rows(
        robot.chassis,
        MotionLimits(
            wheel_speed=share * robot.max_wheel_speed,
            acceleration_faces=robot.acceleration_faces / share,
        ),
    )


@cache
def reference_of(name: str, robot: str):
    """Return a reference; shapes use :data:`SHARE` of the limits in every case, or less.

    Those of :data:`LINK_SHAPES` do so on the nominal robot.
    """
    if name in STEPS:
        return Hold(STEPS[name], STEP_DURATION)
    if name == IMPOSSIBLE:
        return ShapeReference(SHAPES["eight"], IMPOSSIBLE_DURATION)
    shape, least = LINK_SHAPES[name] if name in LINK_SHAPES else (SHAPES[name], MIN_DURATION)
    motion, cases = ShapeReference(shape, least), CASES if name in SHAPES else {"nominal"}
    robots = {CASES[case].robot(ROBOTS[robot]) for case in cases}
    needed = max(shortest_duration_within(motion, limits_of(each, SHARE)) for each in robots)
    return ShapeReference(shape, max(needed, least))


def counted(name: str, t: np.ndarray) -> np.ndarray:
    """Return which samples of a run count."""
    stops_at_once = name in SHAPES and SHAPES[name].ramp == 0.0
    return (t >= SETTLED) & (t <= t[-1] - ENDED if stops_at_once else t <= inf)


def physical_limits(robot: str) -> MotionLimits:
    """Return the whole wheel speed of a robot and :data:`TRACTION` of its forces."""
    limits = MotionLimits.of_robot(ROBOTS[robot], share=TRACTION)
    return replace(limits, wheel_speed=ROBOTS[robot].max_wheel_speed)


@cache
def exact_arrival(robot: str) -> float:
    """Return when the robot can be within :data:`ARRIVED` of the end of the eight in 8 s, in s.

    The earliest arrival along the path from rest to rest that is never ahead of the reference,
    within the wheel speed and :data:`TRACTION` of the forces: the robot follows the time law of the
    reference while it is on time, and has the largest squared speeds x while it is late.
    """
    shape, pieces, per_piece = SHAPES["eight"], 200, 10
    path = piecewise(shape, pieces)
    limits = limit_rows(ROBOTS[robot].chassis, physical_limits(robot))
    a, b, _ = interval_rows(path, limits, per_piece)
    width, top = 1.0 / per_piece, 1e6
    largest = max_squared_speeds(a, b, width, top, (top, 0.0))
    timed = ShapeReference(_Parameter(ramp=shape.ramp), IMPOSSIBLE_DURATION)
    motion_times = np.linspace(0.0, IMPOSSIBLE_DURATION, 200_001)
    motion = timed.motion(motion_times)
    s, rate = motion.poses[:, 0], motion.twists[:, 0]
    wanted = (pieces * np.interp(np.linspace(0.0, 1.0, len(largest)), s, rate)) ** 2
    x, late = np.zeros(len(largest)), np.zeros(len(largest))
    for i, (row, by_square) in enumerate(zip(a, b, strict=True)):
        acting = row != 0.0
        highest = (np.sign(row) - by_square * x[i])[acting] / row[acting]
        lowest = (-np.sign(row) - by_square * x[i])[acting] / row[acting]
        ahead = min(x[i] + 2.0 * width * highest.min(), largest[i + 1])
        if late[i] <= 1e-9:
            ahead = min(ahead, max(wanted[i + 1], x[i] + 2.0 * width * lowest.max()))
        x[i + 1] = max(ahead, 0.0)
        own, asked = (2.0 * width / (v[i] ** 0.5 + v[i + 1] ** 0.5) for v in (x, wanted))
        late[i + 1] = max(late[i] + own - asked, 0.0)
    nodes = np.linspace(0.0, 1.0, len(largest))
    positions = shape.evaluate(nodes).poses
    distance = np.hypot(*(positions - positions[-1])[:, :2].T)
    last = int(np.flatnonzero(distance > ARRIVED)[-1])
    times = np.interp(nodes, s, motion_times) + late
    return float(np.interp(-ARRIVED, -distance[last : last + 2], times[last : last + 2]))


class _Parameter(Shape):
    """The parameter s as x, to evaluate the time law of a shape."""

    def evaluate(self, s) -> PathDerivatives:
        parts = np.zeros((3, len(s), 3))
        parts[0, :, 0], parts[1, :, 0] = s, 1.0
        return PathDerivatives(*parts)


def piecewise(shape: Shape, pieces: int = 200) -> PiecewisePath:
    """Return the cubic Hermite interpolation of a shape."""
    path = shape.evaluate(np.linspace(0.0, 1.0, pieces + 1))
    p, d = path.poses, path.first_derivatives / pieces
    rise = np.diff(p, axis=0)
    coefficients = [p[:-1], d[:-1], 3.0 * rise - 2.0 * d[:-1] - d[1:], d[:-1] + d[1:] - 2.0 * rise]
    return PiecewisePath(np.stack(coefficients, axis=1), tangent=False)


class PathDistance(NamedTuple):
    """Distance of poses to a path, each to the nearest point near that of the pose before."""

    position: np.ndarray
    """Distance, m."""
    heading: np.ndarray
    """Absolute difference of the headings there, rad."""
    share: np.ndarray
    """Parameter s of the nearest point, from 0 to 1."""


def path_distance(shape: Shape, poses: np.ndarray, samples: int = 8000) -> PathDistance:
    """Follow the path with the poses; where it crosses itself, the branch is that of before."""
    s = np.linspace(0.0, 1.0, samples + 1)
    path = shape.evaluate(s).poses
    back, ahead = samples // 50, samples // 8
    nearest, at = [], 0
    for x, y, _ in poses.tolist():
        low, high = max(at - back, 0), min(at + ahead, samples) + 1
        at = low + int(np.argmin(np.hypot(path[low:high, 0] - x, path[low:high, 1] - y)))
        nearest.append(at)
    points = path[nearest]
    return PathDistance(
        np.hypot(*(poses - points)[:, :2].T), np.abs(wrap(poses[:, 2] - points[:, 2])), s[nearest]
    )
