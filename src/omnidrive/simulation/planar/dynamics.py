"""The planar robot from one command to the next."""

from __future__ import annotations

from math import cos, exp, hypot, pi, sin
from typing import Any

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.simulation.planar.traction import (
    Vector,
    along,
    clipped,
    impulse,
    momentum,
    twist_after,
)

_DOWN = 1.5 * pi  # rad that roller 0, ahead of the axle at first, turns on to come to the floor
_AXLES = 0.02  # s in which sprung axles hand on a load


@inlined
def set_commands(body: Any, wheels: Array, spins: Array, twist: Vector) -> None:
    """Wheel speeds for a body twist, all scaled together when one is too fast."""
    peak = 0.0
    for i in range(len(wheels)):
        wheel = wheels[i]
        speed = wheel.drive_x * twist[0] + wheel.drive_y * twist[1] + wheel.drive_turn * twist[2]
        spins[i].command = speed
        peak = max(peak, abs(speed))
    if not peak <= body.max_wheel_speed:  # also when it is not a number
        for i in range(len(wheels)):
            spins[i].command *= body.max_wheel_speed / peak


@inlined
def beside(wheel: Any, angle: float) -> float:
    """How far along its axle, outwards from its middle, a wheel touches the floor, in m.

    Two rows take turns: rollers with an odd number are in the outer one. Axles and contacts give,
    so that both carry for a fifth of the way. On a tilted roller the contact wanders.
    """
    passed = (angle + _DOWN) / wheel.pitch
    roller = round(passed)
    outer = min(5.0 - 10.0 * abs(passed - roller), 1.0) * (1.0 if roller % 2 == 1 else -1.0)
    out: float = wheel.row * outer + wheel.gauss_markov * 2.0 * (passed - roller)
    return out


@inlined
def set_down(body: Any, wheels: Array, motion: Any, spins: Array, h: float) -> None:
    """Where every wheel touches the floor, and what it can push there by its load and friction.

    The weight stays where it is: contacts further out carry less, and a push below the centre of
    mass shifts load backwards.
    """
    mx, my = body.com_height * motion.push_x, body.com_height * motion.push_y
    for i in range(len(wheels)):
        wheel, spin = wheels[i], spins[i]
        out = beside(wheel, spin.angle)
        spin.turn = wheel.push_turn + out * wheel.lever
        mx += wheel.load * out * wheel.axle_x
        my += wheel.load * out * wheel.axle_y
    c, s = cos(motion.yaw), sin(motion.yaw)
    for i in range(len(wheels)):
        wheel = wheels[i]
        x = motion.x + c * wheel.x - s * wheel.y - body.patch_x
        y = motion.y + s * wheel.x + c * wheel.y - body.patch_y
        near = body.patch_radius >= 0.0 and x * x + y * y <= body.patch_radius**2
        friction = body.patch_friction if near else wheel.friction
        load = wheel.load - wheel.share_x * mx - wheel.share_y * my
        spins[i].grip = h * friction * max(load, 0.0)


@inlined
def spin_up_rollers(wheels: Array, motion: Any, spins: Array, rollers: Array, h: float) -> Vector:
    """Let the floor turn the roller that it meets; what that takes from the body's momentum.

    A roller that comes down is turned from what is left of its last turn to the speed of the floor
    below it, across the push: momentum that it carries away. It is sprung in while its neighbours
    still carry, so that it takes nothing of what the wheel can push.
    """
    x, y, turn = 0.0, 0.0, 0.0
    for i in range(len(wheels)):
        wheel, spin = wheels[i], spins[i]
        for k in range(rollers.shape[1]):
            rollers[i, k] *= 1.0 - h * wheel.roller_decay
        on_floor = round((spin.angle + _DOWN) / wheel.pitch) % rollers.shape[1]
        ax, ay = wheel.push_y, -wheel.push_x
        arm = wheel.x * ay - wheel.y * ax
        across = ax * motion.vx + ay * motion.vy + arm * motion.yaw_rate
        slip = across + wheel.roll * spin.speed - rollers[i, on_floor]
        v = (motion.vx, motion.vy, motion.yaw_rate)
        ahead = along(wheel, spin, v) - wheel.radius * spin.speed
        total = hypot(slip, ahead)
        if total > 0.0:
            q = clipped(wheel.roller_mass * slip, spin.grip * abs(slip) / total)
            rollers[i, on_floor] += q / wheel.roller_mass
            spin.speed -= wheel.roll * q / wheel.inertia
            x, y, turn = x + ax * q, y + ay * q, turn + arm * q
    return x, y, turn


@inlined
def free_twist(body: Any, motion: Any, h: float) -> Vector:
    """Body twist after a step without wheels: the centre of mass flies on, in axes that turn."""
    turn = motion.yaw_rate * h
    x = motion.vx - motion.yaw_rate * body.com_y
    y = motion.vy + motion.yaw_rate * body.com_x
    c, s = cos(motion.yaw), sin(motion.yaw)
    x += h * (c * body.pull_x + s * body.pull_y)
    y += h * (c * body.pull_y - s * body.pull_x)
    c, s = cos(turn), sin(turn)
    x, y = c * x + s * y, c * y - s * x
    return x + motion.yaw_rate * body.com_y, y - motion.yaw_rate * body.com_x, motion.yaw_rate


@inlined
def turn_wheels(
    wheels: Array, motion: Any, spins: Array, v: Vector, h: float
) -> tuple[float, float]:
    """Give every wheel the speed that follows from ``v``; return the floor's push on the robot."""
    x, y = 0.0, 0.0
    for i in range(len(wheels)):
        wheel, spin = wheels[i], spins[i]
        q, _, _ = impulse(wheel, spin, v, h)
        x, y = x + wheel.push_x * q / h, y + wheel.push_y * q / h
        if wheel.locked:
            spin.speed = 0.0
            torque = clipped(wheel.gain * spin.target, wheel.limit)
        else:
            taken = wheel.inertia * spin.speed - wheel.radius * q
            gain = h * wheel.gain
            w = (taken + gain * spin.target) / (wheel.inertia + gain)
            torque = wheel.gain * (spin.target - w)
            if abs(torque) > wheel.limit:
                torque = clipped(torque, wheel.limit)
                w = (taken + h * torque) / wheel.inertia
            spin.speed = w
        spin.angle += h * spin.speed
        spin.torque += torque
        motion.work += h * abs(torque * spin.speed)
    return x, y


@inlined
def move_on(motion: Any, v: Vector, h: float) -> None:
    """Hold the body twist ``v`` for ``h`` seconds: along the chord of its arc."""
    half = 0.5 * h * v[2]
    chord = h * (sin(half) / half if abs(half) > 1e-5 else 1.0)
    c, s = chord * cos(motion.yaw + half), chord * sin(motion.yaw + half)
    motion.x += c * v[0] - s * v[1]
    motion.y += s * v[0] + c * v[1]
    motion.yaw += h * v[2]
    motion.vx, motion.vy, motion.yaw_rate = v


@compiled
def drive(  # noqa: PLR0917
    frame: Array,
    wheels: Array,
    motions: Array,
    spins: Array,
    rollers: Float[Array, "wheels rollers"],
    vx: float,
    vy: float,
    yaw_rate: float,
    h: float,
    steps: int,
) -> None:
    """Servo the wheels to a body twist for ``steps`` steps of ``h`` seconds, in place.

    Args:
        frame: The model's record of the robot.
        wheels: The model's records of the wheels.
        motions: The state's record of the robot.
        spins: The state's records of the wheels; afterwards with the mean torques.
        rollers: The state's speeds of the rollers.
        vx: Commanded, in B, in m/s.
        vy: Commanded, in B, in m/s.
        yaw_rate: Commanded, in rad/s.
        h: In s.
        steps: Positive.
    """
    body, motion = frame[0], motions[0]
    set_commands(body, wheels, spins, (vx, vy, yaw_rate))
    kept = exp(-h / body.motor_lag) if body.motor_lag > 0.0 else 0.0
    felt = 1.0 - exp(-h / _AXLES)
    for i in range(len(spins)):
        spins[i].torque = 0.0
    for _ in range(steps):
        for i in range(len(spins)):
            spins[i].target = spins[i].command + kept * (spins[i].target - spins[i].command)
        set_down(body, wheels, motion, spins, h)
        taken = spin_up_rollers(wheels, motion, spins, rollers, h)
        free = momentum(body, free_twist(body, motion, h))
        given = (free[0] - taken[0], free[1] - taken[1], free[2] - taken[2])
        before = (motion.vx, motion.vy, motion.yaw_rate)
        v = twist_after(body, wheels, spins, given, before, h)
        x, y = turn_wheels(wheels, motion, spins, v, h)
        motion.push_x += felt * (x - motion.push_x)
        motion.push_y += felt * (y - motion.push_y)
        move_on(motion, v, h)
    for i in range(len(spins)):
        spins[i].torque /= steps
