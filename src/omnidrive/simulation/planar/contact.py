"""Contact impulses between wheels and floor: one implicit time step, solved exactly.

Rollers turn freely, so that wheel i and the floor exchange impulses only along the roller's axis
p_i. Coulomb friction: the wheel rolls without slip while its impulse stays below the friction
limit, and slips with the limit beyond. Backward Euler of the wheel and of its servo makes the
impulse q_i a decreasing, piecewise linear function of the speed of the wheel's mount. The body
twist v after the step solves

    M (v - free) = sum_i P_i q_i(P_i . v),    P_i = (p_x, p_y, x p_y - y p_x)

the gradient of a strictly convex, piecewise quadratic function. (Time stepping with impulses:
Stewart & Trinkle, Int. J. Numer. Meth. Eng. 39, 1996; the Newton method: Qi & Sun, "A nonsmooth
version of Newton's method", Math. Programming 58, 1993, here with a line search.)

:func:`omnidrive.robot.slip.slip_velocity` is another law: explicit Euler, in which the forces are
proportional to the slip at the start of the step. The law here is implicit and has no slip below
the friction limit.
"""

from __future__ import annotations

from typing import Any

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined

Vector = tuple[float, float, float]

_MAX_ITERATIONS = 20  # typically three or fewer
_MAX_HALVINGS = 40
_SLOPE_TOLERANCE = 1e-9  # relative to the directional derivative at the start of the line search


@inlined
def saturate(value: float, limit: float) -> float:
    """Return ``value`` limited to plus and minus ``limit``."""
    return min(max(value, -limit), limit)


@inlined
def mount_speed(wheel: Any, wheel_state: Any, v: Vector) -> float:
    """Return the speed of a wheel's mount along the direction of its force, m/s."""
    speed: float = (
        wheel.direction_x * v[0] + wheel.direction_y * v[1] + wheel_state.moment_arm * v[2]
    )
    return speed


@inlined
def contact_impulse(wheel: Any, wheel_state: Any, v: Vector, h: float) -> tuple[float, float, int]:
    """Return the floor's impulse on one wheel, its derivative and its mode.

    Without slip the wheel turns by ``w = P . v / radius``, which requires
    ``inertia (w - speed) = h clip(gain (target - w), limit) - radius q``; and
    ``|q| <= max_impulse``.

    Args:
        wheel: Record of the model.
        wheel_state: Record of the state before the step.
        v: Body twist after the step.
        h: Length of the step, s.

    Returns:
        The impulse, N s; minus its derivative with respect to the speed of the mount, kg; the mode:
        0 while the wheel rolls, 1 or -1 while it rolls with the motor at its torque limit, 2 or -2
        while it slips.
    """
    w = mount_speed(wheel, wheel_state, v) / wheel.radius
    gain, limit = h * wheel.gain, h * wheel.limit
    if wheel.locked:
        gain, limit = 0.0, 0.0
    motor = gain * (wheel_state.target - w)
    stiffness, mode = wheel.inertia + gain, 0
    if abs(motor) > limit:
        stiffness, mode = wheel.inertia, 1 if motor > 0.0 else -1
        motor = saturate(motor, limit)
    q = (motor - wheel.inertia * (w - wheel_state.speed)) / wheel.radius
    if abs(q) > wheel_state.max_impulse:
        return saturate(q, wheel_state.max_impulse), 0.0, 2 if q > 0.0 else -2
    return q, stiffness / (wheel.radius * wheel.radius), mode


@inlined
def momentum(body: Any, v: Vector) -> Vector:
    """Return the momentum M v of the robot about B's origin, in B."""
    return (
        body.mass * (v[0] - body.com_y * v[2]),
        body.mass * (v[1] + body.com_x * v[2]),
        body.mass * (body.com_x * v[1] - body.com_y * v[0]) + body.inertia * v[2],
    )


@inlined
def residual(  # noqa: PLR0917
    body: Any, wheels: Array, wheel_states: Array, free: Vector, v: Vector, h: float
) -> tuple[Vector, bool]:
    """Return the residual of the momentum balance at ``v``, and whether a mode changed.

    The derivatives and modes of the impulses are stored in ``wheel_states``.
    """
    x, y, yaw = momentum(body, v)
    x, y, yaw = x - free[0], y - free[1], yaw - free[2]
    changed = False
    for i in range(len(wheels)):
        wheel, wheel_state = wheels[i], wheel_states[i]
        q, effective_mass, mode = contact_impulse(wheel, wheel_state, v, h)
        x -= wheel.direction_x * q
        y -= wheel.direction_y * q
        yaw -= wheel_state.moment_arm * q
        changed |= mode != wheel_state.mode
        wheel_state.effective_mass, wheel_state.mode = effective_mass, mode
    return (x, y, yaw), changed


@inlined
def newton_step(body: Any, wheels: Array, wheel_states: Array, r: Vector) -> Vector:
    """Return the change of twist that makes the residual ``r`` zero if no mode changes.

    Elimination without pivoting; the matrix is symmetric and positive definite.
    """
    xx, yy, tt = body.mass, body.mass, body.inertia
    xy, xt, yt = 0.0, -body.mass * body.com_y, body.mass * body.com_x
    for i in range(len(wheels)):
        px, py, arm = wheels[i].direction_x, wheels[i].direction_y, wheel_states[i].moment_arm
        k = wheel_states[i].effective_mass
        xx += k * px * px
        yy += k * py * py
        tt += k * arm * arm
        xy += k * px * py
        xt += k * px * arm
        yt += k * py * arm
    a, b = xy / xx, xt / xx
    yy, yt, tt = yy - a * xy, yt - a * xt, tt - b * xt
    gy, gt = r[1] - a * r[0], r[2] - b * r[0]
    c = yt / yy
    dt = -(gt - c * gy) / (tt - c * yt)
    dy = -gy / yy - c * dt
    return -r[0] / xx - a * dy - b * dt, dy, dt


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def add_scaled(v: Vector, d: Vector, t: float) -> Vector:
    """Return ``v + t d``."""
    return v[0] + t * d[0], v[1] + t * d[1], v[2] + t * d[2]


@compiled
def solve_twist(  # noqa: PLR0917
    body: Any, wheels: Array, wheel_states: Array, free: Vector, guess: Vector, h: float
) -> Vector:
    """Return the body twist at the end of a step; m/s, m/s, rad/s.

    Args:
        body: Record of the model.
        wheels: Records of the model.
        wheel_states: Records of the state before the step, with the friction limits of this step.
        free: Momentum that the robot would have without the wheels' impulses: ``M free``.
        guess: First iterate; it affects the last digits of the result.
        h: Length of the step, s.
    """
    v = guess
    r, _ = residual(body, wheels, wheel_states, free, v, h)
    for _ in range(_MAX_ITERATIONS):
        d = newton_step(body, wheels, wheel_states, r)
        initial = dot(r, d)  # derivative of the convex function along d; negative
        low, high, t = 0.0, 1.0, 1.0
        after = add_scaled(v, d, 1.0)
        r, changed = residual(body, wheels, wheel_states, free, after, h)
        if not changed:
            return after
        slope = dot(r, d)
        for _ in range(_MAX_HALVINGS):
            if slope <= -_SLOPE_TOLERANCE * initial and (t == 1.0 or slope >= 0.5 * initial):
                break
            low, high = (low, t) if slope > 0.0 else (t, high)
            t = 0.5 * (low + high)
            after = add_scaled(v, d, t)
            r, _ = residual(body, wheels, wheel_states, free, after, h)
            slope = dot(r, d)
        v = after
    return v
