"""Targets that lead from the present pose to a standing target in minimum time."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.motion.acceleration_ratio import acceleration_load
from omnidrive.robot.slip import Vector

_CELLS = 32
"""Intervals of the path, on each of which the acceleration is constant."""
_SPEED_SHARE = 0.99
"""Share of the speed limit that the motion uses."""
_BRAKING = 0.88
"""Share of the largest acceleration with which the motion brakes."""
_RATE = 8.5
"""Greatest ratio of speed to remaining distance, in 1/s: time-optimal braking alone has no limit of
this ratio, so that lags that the model does not have would cause oscillations."""


@compiled
def minimum_time_targets(  # noqa: PLR0917
    start: Float[Array, " 3"],
    twist: Vector,
    target: Vector,
    weights: Float[Array, " 3"],
    faces: Float[Array, "faces 3"],
    wheels: Float[Array, "wheels 3"],
    max_wheel_speed: float,
    dt: float,
    lead: float,
    reserve: float,
    reached: float,
    prompt: float,
    targets: Float[Array, "points 3"],
) -> None:
    """Fill in targets ``dt`` (s) apart along the straight line from ``start`` to ``target``.

    The plan of least squares overshoots a distant target, because it gives less weight to a small
    error afterwards than to a fast approach. On a straight line in (x, y, yaw) all coordinates
    arrive together, none passes its target, and the fastest motion follows from the limits by one
    backward and one forward pass (Bobrow, Dubowsky & Gibson, Int. J. Robotics Research 4, 1985; the
    limits turn with the heading). A robot that is faster than that decelerates with the
    reserve until it is not, or at the constant rate at which it stops at the target.

    Args:
        start: Present pose in W; m, m, rad.
        twist: Present body twist.
        target: Target pose in W, whose yaw is within half a turn of that of ``start``.
        weights: Weights of the coordinates, with which the speed along the line is measured.
        faces: Limits of acceleration, ``|faces @ acceleration| <= 1`` in B.
        wheels: Wheel matrix.
        max_wheel_speed: In rad/s.
        dt: In s.
        lead: Time in s by which targets are ahead, because a change of the twist begins with the
            next command; see :func:`~.slip_compensation.predict_change`.
        reserve: Largest acceleration over those limits, at least 1.
        reached: Share of the acceleration that the robot reaches, 0 to 1; braking, and the ratio of
            speed to distance, are reduced by it.
        prompt: Factor of the ratio of speed to distance for a delayed response, up to 1.
        targets: Output; poses in W, the first of which is near ``start``.
    """
    error = (start[0] - target[0], start[1] - target[1], start[2] - target[2])
    accelerations, squared = _limits(start[2], error, faces, wheels, max_wheel_speed)
    braking = _BRAKING * reserve * reached
    for i in range(_CELLS + 1):
        rate = _RATE * min(reached, prompt) * (1.0 - i / _CELLS)
        squared[i] = min(squared[i], rate * rate)
    min_acceleration = inf
    for i in range(_CELLS - 1, -1, -1):
        min_acceleration = min(min_acceleration, accelerations[i])
        reachable = squared[i + 1] + 2.0 * braking * accelerations[i] / _CELLS
        squared[i] = min(squared[i], reachable)
    speed = _speed(start[2], twist, error, weights)
    if speed > 0.0 and 0.5 * speed * speed > reserve * min_acceleration:
        _brake(speed, error, target, dt, lead, targets)
        return
    _fill(speed, accelerations, squared, error, target, dt, lead, reserve, targets)


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
        load, speed = acceleration_load(faces, (x, y, error[2])), 0.0
        for j in range(len(wheels)):
            speed = max(speed, abs(wheels[j, 0] * x + wheels[j, 1] * y + wheels[j, 2] * error[2]))
        here = 1.0 / load
        if i > 0:
            accelerations[i - 1] = min(before, here)
        before = here
        squared[i] = (_SPEED_SHARE * max_wheel_speed / speed) ** 2
    return accelerations, squared


@compiled
def _fill(  # noqa: PLR0917
    speed: float,
    accelerations: Float[Array, " cells"],
    squared: Float[Array, " nodes"],
    error: Vector,
    target: Vector,
    dt: float,
    lead: float,
    reserve: float,
    targets: Float[Array, "points 3"],
) -> None:
    """Fill in targets of the fastest motion from ``speed`` (1/s) to the speeds at the nodes."""
    times, squares = np.zeros(_CELLS + 1), np.empty(_CELLS + 1)
    squares[0] = max(speed, 0.0) ** 2
    away = max(-speed, 0.0)  # it stops first, at a distance beyond the start
    stop_time, stop = away / accelerations[0], 0.5 * away * away / accelerations[0]
    for i in range(_CELLS):
        change = 2.0 * accelerations[i] / _CELLS
        slowest = squares[i] - reserve * change
        squares[i + 1] = max(min(squares[i] + change, squared[i + 1]), slowest)
        times[i + 1] = times[i] + 2.0 / _CELLS / (sqrt(squares[i]) + sqrt(squares[i + 1]))
    i, ahead = 0, 0.0
    for k in range(len(targets)):
        t = k * dt + lead
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
                left *= 1.0 + stop
        if k == 0:
            ahead = 1.0 - left
        for a in range(3):
            targets[k, a] = target[a] + (left + ahead) * error[a]


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
    error: Vector,
    target: Vector,
    dt: float,
    lead: float,
    targets: Float[Array, "points 3"],
) -> None:
    """Fill in targets that stop at the target at a constant deceleration beyond the limits."""
    needed = 0.5 * speed * speed
    lead = min(lead, speed / needed)
    ahead = lead * speed - 0.5 * needed * lead * lead
    for k in range(len(targets)):
        t = min(k * dt + lead, speed / needed)
        left = 1.0 - speed * t + 0.5 * needed * t * t
        for a in range(3):
            targets[k, a] = target[a] + (left + ahead) * error[a]
