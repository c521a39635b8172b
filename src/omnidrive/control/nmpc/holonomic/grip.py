"""What to ask of wheels that slip, so that the robot does what is wanted."""

from __future__ import annotations

from math import ceil, cos, sin
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.holonomic.motion import twist
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Robot
from omnidrive.robot.slip import Vector, slip_velocity

_SHARE = 0.95
"""Part of its grip that a wheel is counted on for: load shifts from wheel to wheel."""
_STEP = 0.75
"""Length of an integration step, as a part of the shortest time constant."""
_LEAST_LAG = 1e-4
"""In s: shorter ones are none, and would take ever more integration steps."""
_TRIALS = 6
"""Corrections of what is asked for: each leaves about lag / dt of the error, while wheels hold."""
_SHORT = 2.0
"""Sample time, as a multiple of a lag, up to which what is asked for is that against the lag: who
asks for where a robot is so soon swings to and fro."""
_BISECTIONS = 8


class Grip(NamedTuple):
    """How wheels push a robot towards the body twist c that it is asked for.

    Wheel i pushes along its direction in proportion to how much its rim is faster than the robot,
    and no more than its grip::

        f_i = clip(rims_i @ (stiffness (c - b)), -most, most)
        inertia (db/dt + w x b) = rims^T f

    with the body twist b, of yaw rate w. While no wheel is at the end of its grip these are lags of
    ``inertia / (stiffness sum(rim_jacobian^2))``, for wheels whose columns of ``rim_jacobian`` are
    orthogonal, as those of every symmetric robot; beyond, robots fall behind by far
    more. Creep of rollers, the motors' servos and their inertia are all in the stiffness
    (Pacejka, "Tire and Vehicle
    Dynamics", 3rd ed. 2012, section 1.2: force in proportion to slip, up to friction).

    Nothing measured corrects it: it is as good as the robot's mass, friction and lags.
    """

    rim_jacobian: Float[Array, "wheels 3"]
    """Speed of every rim per unit of body twist, in 1, 1 and m/rad."""
    inertia: Float[Array, " 3"]
    """Mass in kg, twice, and yaw inertia in kg m^2."""
    stiffness: Float[Array, " 3"]
    """Against slip in translation, twice, and in rotation, in N s/m."""
    most: float
    """In N."""
    max_rim_speed: float
    """That a wheel can be asked for, in m/s."""
    may_spin: bool
    """Whether a wheel may be asked for so much that it still spins in the end, where the robot does
    not get along as wanted: every moment of the step then pushes, but odometry loses count."""

    @classmethod
    def of(cls, robot: Robot, *, may_spin: bool = True) -> Grip:
        """Of a robot with its mass and friction, as stiff as explains its lags.

        Raises:
            InvalidInput: Mass or friction is not positive and finite, or a lag below 0.1 ms.
        """
        rim_jacobian, inertia = np.ascontiguousarray(robot.rim_jacobian), robot.inertia
        lags = np.array([robot.lag[0], *robot.lag])
        for name, values in (("mass", inertia), ("push", robot.max_force)):
            if not (np.isfinite(values).all() and np.min(values) > 0.0):
                raise InvalidInput(f"a grip needs a positive {name}, got {np.min(values):g}")
        if not (np.isfinite(lags).all() and lags.min() >= _LEAST_LAG):
            raise InvalidInput(f"a grip needs lags of at least 0.1 ms, got {lags.min():g} s")
        return cls(
            rim_jacobian,
            inertia,
            inertia / (lags * (rim_jacobian**2).sum(axis=0)),
            _SHARE * robot.max_force,
            robot.wheel.radius * robot.max_wheel_speed,
            may_spin,
        )

    def ask(self, wanted: BodyTwist, before: BodyTwist, dt: float) -> tuple[BodyTwist, BodyTwist]:
        """What to ask for so that the robot moves for ``dt`` seconds as by a wanted twist.

        Args:
            wanted: The twist that, held, leads where the robot shall be.
            before: Its twist at first.
            dt: In s.

        Returns:
            The twist to ask for, as near as the wheels allow, and the robot's twist in the end.
        """
        asked, after = _ask(self, _vector(wanted), _vector(before), float(dt))
        return BodyTwist(*asked), BodyTwist(*after)


def _vector(twist: BodyTwist) -> Vector:
    return float(twist.vx), float(twist.vy), float(twist.yaw_rate)


@compiled
def _ask(grip: Grip, wanted: Vector, before: Vector, dt: float) -> tuple[Vector, Vector]:
    """:meth:`Grip.ask`: as much more, time and again, as the robot would still fall behind."""
    asked, after = wanted, before
    lags = grip.inertia / (grip.stiffness * (grip.rim_jacobian**2).sum(axis=0))
    if dt < _SHORT * lags.max():
        x, y, yaw = lags / dt
        asked = (
            wanted[0] + x * (wanted[0] - before[0]),
            wanted[1] + y * (wanted[1] - before[1]),
            wanted[2] + yaw * (wanted[2] - before[2]),
        )
        asked = _within(grip, asked)
    else:
        for _ in range(_TRIALS):
            done, _ = driven(grip, before, asked, dt)
            asked = (
                asked[0] + wanted[0] - done[0],
                asked[1] + wanted[1] - done[1],
                asked[2] + wanted[2] - done[2],
            )
            asked = _within(grip, asked)
    _, after = driven(grip, before, asked, dt)
    if grip.may_spin or not _spins(grip, asked, after):
        return asked, after
    return _held(grip, asked, before, dt)


@compiled
def _held(grip: Grip, asked: Vector, before: Vector, dt: float) -> tuple[Vector, Vector]:
    """As large a part of the change asked for as leaves no wheel spinning in the end."""
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        part = _between(before, asked, middle)
        _, after = driven(grip, before, part, dt)
        if _spins(grip, part, after):
            high = middle
        else:
            low = middle
    part = _between(before, asked, low)
    _, after = driven(grip, before, part, dt)
    return part, after


@inlined
def _between(one: Vector, other: Vector, part: float) -> Vector:
    """A part of the way from one to the other."""
    x, y, yaw = one
    return x + part * (other[0] - x), y + part * (other[1] - y), yaw + part * (other[2] - yaw)


@inlined
def _pull(stiffness: Float[Array, " 3"], asked: Vector, moving: Vector) -> Vector:
    """What slip pulls at the robot, before the rims share it."""
    return (
        stiffness[0] * (asked[0] - moving[0]),
        stiffness[1] * (asked[1] - moving[1]),
        stiffness[2] * (asked[2] - moving[2]),
    )


@inlined
def _at_rim(rim_jacobian: Float[Array, "wheels 3"], wheel: int, vector: Vector) -> float:
    """What a twist, or a pull, comes to along the rim of a wheel."""
    x, y, yaw = vector
    return float(
        rim_jacobian[wheel, 0] * x + rim_jacobian[wheel, 1] * y + rim_jacobian[wheel, 2] * yaw
    )


@inlined
def _peak(rim_jacobian: Float[Array, "wheels 3"], vector: Vector) -> float:
    """The largest of a twist, or a pull, along any rim, whichever way."""
    peak = 0.0
    for i in range(len(rim_jacobian)):
        peak = max(peak, abs(_at_rim(rim_jacobian, i, vector)))
    return peak


@inlined
def _spins(grip: Grip, asked: Vector, after: Vector) -> bool:
    """Whether any wheel is at the end of its grip."""
    return _peak(grip.rim_jacobian, _pull(grip.stiffness, asked, after)) >= grip.most


@inlined
def _within(grip: Grip, asked: Vector) -> Vector:
    """The largest multiple of a twist, at most 1, that no rim is too slow for."""
    part = grip.max_rim_speed / max(grip.max_rim_speed, _peak(grip.rim_jacobian, asked))
    return part * asked[0], part * asked[1], part * asked[2]


@compiled
def driven(grip: Grip, before: Vector, asked: Vector, dt: float) -> tuple[Vector, Vector]:
    """What a robot does that is asked for a twist for ``dt`` seconds.

    By Euler's explicit method, which loses just the distance that a lag does, however long a step.

    Returns:
        The twist that, held, leads to the same place; the twist in the end.
    """
    rim_jacobian, inertia, stiffness = grip.rim_jacobian, grip.inertia, grip.stiffness
    fastest = 0.0
    for a in range(3):
        fastest = max(fastest, stiffness[a] * (rim_jacobian[:, a] ** 2).sum() / inertia[a])
    steps = ceil(dt * fastest / _STEP)
    h = dt / steps
    forces, limits = np.empty(len(rim_jacobian)), np.full(len(rim_jacobian), grip.most)
    velocity = before
    x, y, yaw = 0.0, 0.0, 0.0
    for _ in range(steps):
        pull = _pull(stiffness, asked, velocity)
        for i in range(len(rim_jacobian)):
            forces[i] = _at_rim(rim_jacobian, i, pull)
        vx, vy, w = velocity
        turn = h * w
        c, s = cos(yaw + 0.5 * turn), sin(yaw + 0.5 * turn)
        x, y, yaw = x + h * (c * vx - s * vy), y + h * (s * vx + c * vy), yaw + turn
        velocity, _ = slip_velocity(velocity, forces, limits, rim_jacobian, inertia, h)
    ahead, left = twist(dt, 0.0, x / dt, y / dt, yaw / dt)
    return (ahead, left, yaw / dt), velocity
