"""What the floor does to the robot in one step of time: an implicit step, solved exactly.

Rollers turn freely, so that wheel i and floor push each other only along the roller's axis p_i.
Coulomb: as long as wheel and mount move alike along it, with any impulse up to the grip; beyond,
with the grip. Backward Euler of the wheel and of its servo makes the impulse q_i a falling,
piecewise linear function of the mount's speed, and the body's twist v after the step solves

    M (v - free) = sum_i P_i q_i(P_i . v),    P_i = (p_x, p_y, x p_y - y p_x)

the gradient of a strictly convex, piecewise quadratic function. (Time stepping with impulses:
Stewart & Trinkle, Int. J. Numer. Meth. Eng. 39, 1996; the Newton method: Qi & Sun, "A nonsmooth
version of Newton's method", Math. Programming 58, 1993, here with a line search.)
"""

from __future__ import annotations

from typing import Any

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined

Vector = tuple[float, float, float]

_MOST_STEPS = 20  # three are many
_HALVINGS = 40
_FLAT = 1e-9  # part of the slope at first that is none


@inlined
def clipped(value: float, limit: float) -> float:
    """``value``, within plus and minus ``limit``."""
    return min(max(value, -limit), limit)


@inlined
def along(wheel: Any, spin: Any, v: Vector) -> float:
    """Speed in m/s of a wheel's mount along its push."""
    speed: float = wheel.push_x * v[0] + wheel.push_y * v[1] + spin.turn * v[2]
    return speed


@inlined
def impulse(wheel: Any, spin: Any, v: Vector, h: float) -> tuple[float, float, int]:
    """What the floor gives the robot at one wheel in N s, how it falls with the speed, and why.

    Without slip the wheel turns by ``w = P . v / radius``, which takes
    ``inertia (w - speed) = h clip(gain (target - w), limit) - radius q``; and ``|q| <= grip``.
    The reason is 0 while the wheel rolls, 1 or -1 while it rolls with all that the motor has, and
    2 or -2 while it slips.

    Args:
        wheel: Record of the model.
        spin: Record of the state before the step.
        v: Body twist after the step.
        h: Duration of the step, in s.
    """
    w = along(wheel, spin, v) / wheel.radius
    gain, most = h * wheel.gain, h * wheel.limit
    if wheel.locked:
        gain, most = 0.0, 0.0
    given = gain * (spin.target - w)
    stiffness, reason = wheel.inertia + gain, 0
    if abs(given) > most:
        stiffness, reason = wheel.inertia, 1 if given > 0.0 else -1
        given = clipped(given, most)
    q = (given - wheel.inertia * (w - spin.speed)) / wheel.radius
    if abs(q) > spin.grip:
        return clipped(q, spin.grip), 0.0, 2 if q > 0.0 else -2
    return q, stiffness / (wheel.radius * wheel.radius), reason


@inlined
def momentum(body: Any, v: Vector) -> Vector:
    """Of the robot about B's origin, in B: M v."""
    return (
        body.mass * (v[0] - body.com_y * v[2]),
        body.mass * (v[1] + body.com_x * v[2]),
        body.mass * (body.com_x * v[1] - body.com_y * v[0]) + body.inertia * v[2],
    )


@inlined
def surplus(  # noqa: PLR0917
    body: Any, wheels: Array, spins: Array, given: Vector, v: Vector, h: float
) -> tuple[Vector, bool]:
    """Momentum of ``v`` beyond what was there and what the floor gives; whether reasons changed.

    The impulses' slopes and reasons are noted in ``spins``.
    """
    x, y, turn = momentum(body, v)
    x, y, turn = x - given[0], y - given[1], turn - given[2]
    changed = False
    for i in range(len(wheels)):
        wheel, spin = wheels[i], spins[i]
        q, slope, reason = impulse(wheel, spin, v, h)
        x -= wheel.push_x * q
        y -= wheel.push_y * q
        turn -= spin.turn * q
        changed |= reason != spin.reason
        spin.slope, spin.reason = slope, reason
    return (x, y, turn), changed


@inlined
def newton_step(body: Any, wheels: Array, spins: Array, left: Vector) -> Vector:
    """Change of twist that takes the surplus ``left`` away if all reasons stay as they are.

    Elimination without pivoting; the matrix is symmetric and positive definite.
    """
    xx, yy, tt = body.mass, body.mass, body.inertia
    xy, xt, yt = 0.0, -body.mass * body.com_y, body.mass * body.com_x
    for i in range(len(wheels)):
        px, py, turn = wheels[i].push_x, wheels[i].push_y, spins[i].turn
        k = spins[i].slope
        xx += k * px * px
        yy += k * py * py
        tt += k * turn * turn
        xy += k * px * py
        xt += k * px * turn
        yt += k * py * turn
    a, b = xy / xx, xt / xx
    yy, yt, tt = yy - a * xy, yt - a * xt, tt - b * xt
    gy, gt = left[1] - a * left[0], left[2] - b * left[0]
    c = yt / yy
    dt = -(gt - c * gy) / (tt - c * yt)
    dy = -gy / yy - c * dt
    return -left[0] / xx - a * dy - b * dt, dy, dt


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def stepped(v: Vector, d: Vector, t: float) -> Vector:
    """``v + t d``."""
    return v[0] + t * d[0], v[1] + t * d[1], v[2] + t * d[2]


@compiled
def twist_after(  # noqa: PLR0917
    body: Any, wheels: Array, spins: Array, given: Vector, guess: Vector, h: float
) -> Vector:
    """Body twist at the end of a step; m/s, m/s, rad/s.

    Args:
        body: Record of the model.
        wheels: Records of the model.
        spins: Records of the state before the step, with this step's grip.
        given: Momentum that the robot would have without the wheels' pushes: ``M free``.
        guess: Where the search begins; the result depends on it in the last digits.
        h: Duration of the step, in s.
    """
    v = guess
    left, _ = surplus(body, wheels, spins, given, v, h)
    for _ in range(_MOST_STEPS):
        d = newton_step(body, wheels, spins, left)
        begun = dot(left, d)  # of the convex function along d, negative
        low, high, t = 0.0, 1.0, 1.0
        after = stepped(v, d, 1.0)
        left, changed = surplus(body, wheels, spins, given, after, h)
        if not changed:
            return after
        slope = dot(left, d)
        for _ in range(_HALVINGS):
            if slope <= -_FLAT * begun and (t == 1.0 or slope >= 0.5 * begun):
                break
            low, high = (low, t) if slope > 0.0 else (t, high)
            t = 0.5 * (low + high)
            after = stepped(v, d, t)
            left, _ = surplus(body, wheels, spins, given, after, h)
            slope = dot(left, d)
        v = after
    return v
