"""Targets that lead from the present pose to a standing target in minimum time."""

from __future__ import annotations

from math import exp, sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.robot.slip import Vector

_CELLS = 32
"""Intervals of the path, on each of which the acceleration is constant."""
_SPEED_SHARE = 0.95
"""Share of the speed limit that the motion uses."""
_RATE = 6.0
"""Greatest ratio of speed to remaining distance, in 1/s: time-optimal braking alone has no limit of
this ratio, so that lags that the model does not have would cause oscillations."""


@compiled
def approach(  # noqa: PLR0917
    start: Float[Array, " 3"],
    twist: Vector,
    target: Vector,
    weights: Float[Array, " 3"],
    faces: Float[Array, "faces 3"],
    wheels: Float[Array, "wheels 3"],
    max_wheel_speed: float,
    dt: float,
    age: float,
    targets: Float[Array, "points 3"],
) -> None:
    """Fill in targets ``dt`` (s) apart along the straight line from ``start`` to ``target``.

    The plan of least squares overshoots a distant target, because it gives less weight to a small
    error afterwards than to a fast approach. On a straight line in (x, y, yaw) all coordinates
    arrive together, none passes its target, and the fastest motion follows from the limits by one
    backward and one forward pass (Bobrow, Dubowsky & Gibson, Int. J. Robotics Research 4, 1985; the
    limits turn with the heading). A robot that is too fast to stop at the target with these limits
    decelerates at the constant rate that it needs.

    Args:
        start: Present pose in W; m, m, rad.
        twist: Present body twist.
        target: Target pose in W, whose yaw is within half a turn of that of ``start``.
        weights: Weights of the coordinates, with which the speed along the line is measured.
        faces: Limits of acceleration, ``|faces @ acceleration| <= 1`` in B.
        wheels: Wheel matrix.
        max_wheel_speed: In rad/s.
        dt: In s.
        age: Time since the robot had this twist, in s: half a sample time if the twist is constant
            within a sample, 0 if it changes continuously.
        targets: Output; poses in W, the first of which is near ``start``.
    """
    error = (start[0] - target[0], start[1] - target[1], start[2] - target[2])
    accelerations, squared = _limits(start[2], error, faces, wheels, max_wheel_speed)
    for i in range(_CELLS - 1, -1, -1):  # braking
        reachable = squared[i + 1] + 2.0 * accelerations[i] / _CELLS
        squared[i] = min(squared[i], reachable)
    speed = _speed(start[2], twist, error, weights)
    if speed * speed > squared[0] and speed > 0.0:
        _brake(speed, accelerations.min(), error, target, dt, targets)
        return
    _fill(speed, accelerations, squared, error, target, dt, age, targets)


@compiled
def _limits(
    yaw: float,
    error: Vector,
    faces: Float[Array, "faces 3"],
    wheels: Float[Array, "wheels 3"],
    max_wheel_speed: float,
) -> tuple[Float[Array, " cells"], Float[Array, " nodes"]]:
    """Return accelerations in every cell, and squares of the speeds at the nodes between them.

    Speed and acceleration are those of the remaining share of the line, in 1/s and 1/s^2.
    """
    accelerations, squared = np.empty(_CELLS), np.empty(_CELLS + 1)
    before = 0.0
    for i in range(_CELLS + 1):
        left = 1.0 - i / _CELLS
        heading = yaw - (1.0 - left) * error[2]
        c, s = np.cos(heading), np.sin(heading)
        x, y = c * error[0] + s * error[1], c * error[1] - s * error[0]
        load, speed = 0.0, 0.0
        for j in range(len(faces)):
            load = max(load, abs(faces[j, 0] * x + faces[j, 1] * y + faces[j, 2] * error[2]))
        for j in range(len(wheels)):
            speed = max(speed, abs(wheels[j, 0] * x + wheels[j, 1] * y + wheels[j, 2] * error[2]))
        here = 1.0 / load
        if i > 0:
            accelerations[i - 1] = min(before, here)
        before = here
        squared[i] = min(_SPEED_SHARE * max_wheel_speed / speed, _RATE * left) ** 2
    return accelerations, squared


@compiled
def _fill(  # noqa: PLR0917
    speed: float,
    accelerations: Float[Array, " cells"],
    squared: Float[Array, " nodes"],
    error: Vector,
    target: Vector,
    dt: float,
    age: float,
    targets: Float[Array, "points 3"],
) -> None:
    """Fill in targets of the fastest motion from ``speed`` (1/s), below the speeds at the nodes."""
    times, squares = np.zeros(_CELLS + 1), np.empty(_CELLS + 1)
    squares[0] = max(speed, 0.0) ** 2
    away = max(-speed, 0.0)  # it stops first, at a distance beyond the start
    stop_time, stop = away / accelerations[0], 0.5 * away * away / accelerations[0]
    for i in range(_CELLS):
        fastest = squares[i] + 2.0 * accelerations[i] / _CELLS
        squares[i + 1] = min(fastest, squared[i + 1])
        times[i + 1] = times[i] + 2.0 / _CELLS / (sqrt(squares[i]) + sqrt(squares[i + 1]))
    i = 0
    ago = 1.0 + max(speed, 0.0) * age
    for k in range(len(targets)):
        t = k * dt + age
        if t < stop_time:
            left = 1.0 + away * t - 0.5 * accelerations[0] * t * t
        else:
            t -= stop_time
            while i < _CELLS - 1 and times[i + 1] <= t:
                i += 1
            if t >= times[_CELLS]:
                left = 0.0
            else:
                late, cell = t - times[i], 1.0 / _CELLS
                acceleration = 0.5 * (squares[i + 1] - squares[i]) / cell
                left = 1.0 - i * cell - late * (sqrt(squares[i]) + 0.5 * acceleration * late)
                left *= (1.0 + stop) * ago
        for a in range(3):
            targets[k, a] = target[a] + left * error[a]


@compiled
def _speed(yaw: float, twist: Vector, error: Vector, weights: Float[Array, " 3"]) -> float:
    """Return the rate at which the error decreases, in 1/s: least squares over the coordinates."""
    c, s = np.cos(yaw), np.sin(yaw)
    velocity = (c * twist[0] - s * twist[1], s * twist[0] + c * twist[1], twist[2])
    along, total = 0.0, 0.0
    for a in range(3):
        along -= weights[a] * error[a] * velocity[a]
        total += weights[a] * error[a] * error[a]
    return along / total


@compiled
def _brake(  # noqa: PLR0917
    speed: float,
    acceleration: float,
    error: Vector,
    target: Vector,
    dt: float,
    targets: Float[Array, "points 3"],
) -> None:
    """Fill in targets of a robot that is faster than its limits allow at this distance.

    Near the target, where only the ratio of speed to distance is too large, the error decreases
    exponentially; otherwise the deceleration is the constant one that stops at the target.
    """
    needed = 0.5 * speed * speed
    for k in range(len(targets)):
        if needed <= acceleration:
            left = exp(-speed * k * dt)
        else:
            t = min(k * dt, speed / needed)
            left = 1.0 - speed * t + 0.5 * needed * t * t
        for a in range(3):
            targets[k, a] = target[a] + left * error[a]
