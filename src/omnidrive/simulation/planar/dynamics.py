"""Time integration of the planar robot from one command to the next."""

from __future__ import annotations

from math import cos, exp, hypot, pi, sin
from typing import Any

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.simulation.planar.contact import (
    Vector,
    contact_impulse,
    momentum,
    mount_speed,
    saturate,
    solve_twist,
)

_FLOOR_ANGLE = 1.5 * pi  # rad; angle from roller 0, which starts ahead of the axle, to the floor
_AXLE_LAG = 0.02  # s; time constant with which sprung axles transmit a change of load
_WHEEL_SPEED, _TORQUE, _FRICTION = 1, 2, 4  # of Saturation


@inlined
def set_commands(body: Any, wheels: Array, wheel_states: Array, twist: Vector) -> bool:
    """Set the commanded wheel speeds of a body twist; return whether one exceeded the limit.

    In that case they are scaled down together.
    """
    peak = 0.0
    for i in range(len(wheels)):
        wheel = wheels[i]
        speed = wheel.drive_x * twist[0] + wheel.drive_y * twist[1] + wheel.drive_yaw * twist[2]
        wheel_states[i].command = speed
        peak = max(peak, abs(speed))
    scaled = not peak <= body.max_wheel_speed  # true for NaN too
    if scaled:
        for i in range(len(wheels)):
            wheel_states[i].command *= body.max_wheel_speed / peak
    return scaled


@inlined
def contact_offset(wheel: Any, angle: float) -> float:
    """Return the position of a wheel's contact along its axle, outwards from the centre, m.

    Two rows alternate: rollers with odd numbers are in the outer one. Because axles and contacts
    are elastic, both rows carry load during a fifth of the pitch. On a tilted roller the contact
    moves along the axle.
    """
    passed = (angle + _FLOOR_ANGLE) / wheel.pitch
    roller = round(passed)
    row = min(5.0 - 10.0 * abs(passed - roller), 1.0) * (1.0 if roller % 2 == 1 else -1.0)
    offset: float = wheel.row_offset * row + wheel.contact_drift * 2.0 * (passed - roller)
    return offset


@inlined
def set_contacts(body: Any, wheels: Array, motion: Any, wheel_states: Array, h: float) -> None:
    """Set the contact's moment arm and the largest impulse of every wheel, from load and friction.

    The centre of mass is fixed in B: contacts further outwards carry less load, and a force below
    the centre of mass shifts load backwards.
    """
    mx, my = body.com_height * motion.force_x, body.com_height * motion.force_y
    for i in range(len(wheels)):
        wheel, wheel_state = wheels[i], wheel_states[i]
        offset = contact_offset(wheel, wheel_state.angle)
        wheel_state.moment_arm = wheel.direction_yaw + offset * wheel.moment_per_offset
        mx += wheel.load * offset * wheel.axle_x
        my += wheel.load * offset * wheel.axle_y
    c, s = cos(motion.yaw), sin(motion.yaw)
    for i in range(len(wheels)):
        wheel = wheels[i]
        x = motion.x + c * wheel.x - s * wheel.y - body.patch_x
        y = motion.y + s * wheel.x + c * wheel.y - body.patch_y
        in_patch = body.patch_radius >= 0.0 and x * x + y * y <= body.patch_radius**2
        friction = body.patch_friction if in_patch else wheel.friction
        load = wheel.load - wheel.share_x * mx - wheel.share_y * my
        wheel_states[i].max_impulse = h * friction * max(load, 0.0)


@inlined
def spin_up_rollers(
    wheels: Array, motion: Any, wheel_states: Array, rollers: Array, h: float
) -> Vector:
    """Accelerate the roller in contact on every wheel; return the momentum that the body loses.

    The floor accelerates a roller that comes into contact from its remaining speed to the speed of
    the contact, across the wheel's force, and the roller keeps this momentum when it leaves the
    floor. Its acceleration does not reduce the wheel's force, because the neighbouring rollers also
    carry load at that moment.
    """
    x, y, yaw = 0.0, 0.0, 0.0
    for i in range(len(wheels)):
        wheel, wheel_state = wheels[i], wheel_states[i]
        for k in range(rollers.shape[1]):
            rollers[i, k] *= 1.0 - h * wheel.roller_decay
        in_contact = round((wheel_state.angle + _FLOOR_ANGLE) / wheel.pitch) % rollers.shape[1]
        ax, ay = wheel.direction_y, -wheel.direction_x
        arm = wheel.x * ay - wheel.y * ax
        across = ax * motion.vx + ay * motion.vy + arm * motion.yaw_rate
        slip = across + wheel.roller_speed_ratio * wheel_state.speed - rollers[i, in_contact]
        v = (motion.vx, motion.vy, motion.yaw_rate)
        along = mount_speed(wheel, wheel_state, v) - wheel.radius * wheel_state.speed
        total = hypot(slip, along)
        if total > 0.0:
            q = saturate(wheel.roller_mass * slip, wheel_state.max_impulse * abs(slip) / total)
            rollers[i, in_contact] += q / wheel.roller_mass
            wheel_state.speed -= wheel.roller_speed_ratio * q / wheel.inertia
            x, y, yaw = x + ax * q, y + ay * q, yaw + arm * q
    return x, y, yaw


@inlined
def free_twist(body: Any, motion: Any, h: float) -> Vector:
    """Return the body twist after a step without wheel forces, in the turned frame B."""
    turn = motion.yaw_rate * h
    x = motion.vx - motion.yaw_rate * body.com_y
    y = motion.vy + motion.yaw_rate * body.com_x
    c, s = cos(motion.yaw), sin(motion.yaw)
    x += h * (c * body.gravity_x + s * body.gravity_y)
    y += h * (c * body.gravity_y - s * body.gravity_x)
    c, s = cos(turn), sin(turn)
    x, y = c * x + s * y, c * y - s * x
    return x + motion.yaw_rate * body.com_y, y - motion.yaw_rate * body.com_x, motion.yaw_rate


@inlined
def update_wheels(
    wheels: Array, motion: Any, wheel_states: Array, v: Vector, h: float
) -> tuple[float, float]:
    """Update every wheel from ``v``; return the floor's total force on the robot, in B, N."""
    x, y = 0.0, 0.0
    for i in range(len(wheels)):
        wheel, wheel_state = wheels[i], wheel_states[i]
        q, _, mode = contact_impulse(wheel, wheel_state, v, h)
        if abs(mode) == 2:
            motion.saturated |= _FRICTION
        x, y = x + wheel.direction_x * q / h, y + wheel.direction_y * q / h
        if wheel.locked:
            wheel_state.speed = 0.0
            torque = saturate(wheel.gain * wheel_state.target, wheel.limit)
        else:
            angular_momentum = wheel.inertia * wheel_state.speed - wheel.radius * q
            gain = h * wheel.gain
            w = (angular_momentum + gain * wheel_state.target) / (wheel.inertia + gain)
            torque = wheel.gain * (wheel_state.target - w)
            if abs(torque) > wheel.limit:
                motion.saturated |= _TORQUE
                torque = saturate(torque, wheel.limit)
                w = (angular_momentum + h * torque) / wheel.inertia
            wheel_state.speed = w
        wheel_state.angle += h * wheel_state.speed
        wheel_state.torque += torque
        motion.work += h * abs(torque * wheel_state.speed)
    return x, y


@inlined
def update_pose(motion: Any, v: Vector, h: float) -> None:
    """Move the pose with the constant body twist ``v`` for ``h`` seconds, along its arc's chord."""
    half = 0.5 * h * v[2]
    chord = h * (sin(half) / half if abs(half) > 1e-5 else 1.0)
    c, s = chord * cos(motion.yaw + half), chord * sin(motion.yaw + half)
    motion.x += c * v[0] - s * v[1]
    motion.y += s * v[0] + c * v[1]
    motion.yaw += h * v[2]
    motion.vx, motion.vy, motion.yaw_rate = v


@inlined
def integrate_wheels(  # noqa: PLR0917
    bodies: Array,
    wheels: Array,
    motions: Array,
    wheel_states: Array,
    rollers: Float[Array, "wheels rollers"],
    h: float,
    steps: int,
) -> None:
    """Integrate the commanded wheel speeds in ``wheel_states``, in place.

    Args:
        bodies: Record of the body in the model.
        wheels: Records of the wheels in the model.
        motions: Record of the body in the state.
        wheel_states: Records of the wheels in the state; afterwards with the mean torques.
        rollers: Speeds of the rollers in the state.
        h: Length of a step, s.
        steps: Number of steps; positive.
    """
    body, motion = bodies[0], motions[0]
    decay = exp(-h / body.motor_lag) if body.motor_lag > 0.0 else 0.0
    axle_gain = 1.0 - exp(-h / _AXLE_LAG)
    motion.saturated = 0
    for i in range(len(wheel_states)):
        wheel_states[i].torque = 0.0
    for _ in range(steps):
        for i in range(len(wheel_states)):
            wheel_states[i].target = wheel_states[i].command + decay * (
                wheel_states[i].target - wheel_states[i].command
            )
        set_contacts(body, wheels, motion, wheel_states, h)
        lost = spin_up_rollers(wheels, motion, wheel_states, rollers, h)
        undisturbed = momentum(body, free_twist(body, motion, h))
        free = (undisturbed[0] - lost[0], undisturbed[1] - lost[1], undisturbed[2] - lost[2])
        before = (motion.vx, motion.vy, motion.yaw_rate)
        v = solve_twist(body, wheels, wheel_states, free, before, h)
        x, y = update_wheels(wheels, motion, wheel_states, v, h)
        motion.force_x += axle_gain * (x - motion.force_x)
        motion.force_y += axle_gain * (y - motion.force_y)
        update_pose(motion, v, h)
    for i in range(len(wheel_states)):
        wheel_states[i].torque /= steps


@compiled
def integrate(  # noqa: PLR0917
    bodies: Array,
    wheels: Array,
    motions: Array,
    wheel_states: Array,
    rollers: Float[Array, "wheels rollers"],
    vx: float,
    vy: float,
    yaw_rate: float,
    h: float,
    steps: int,
) -> None:
    """Integrate the command of a body twist for ``steps`` steps of ``h`` seconds, in place.

    Args:
        bodies: This and the other arguments: see :func:`integrate_wheels`.
        wheels: See there.
        motions: See there.
        wheel_states: See there.
        rollers: See there.
        vx: Commanded velocity along x of B, m/s.
        vy: Commanded velocity along y of B, m/s.
        yaw_rate: Commanded yaw rate, rad/s.
        h: See there.
        steps: See there.
    """
    scaled = set_commands(bodies[0], wheels, wheel_states, (vx, vy, yaw_rate))
    integrate_wheels(bodies, wheels, motions, wheel_states, rollers, h, steps)
    if scaled:
        motions[0].saturated |= _WHEEL_SPEED
