"""Newton's step in the controls that are free to move, by one Riccati sweep."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.control.nmpc.point import Point
from omnidrive.control.nmpc.problem import Problem

_LEAST_CURVATURE = 1e-8
"""A control Hessian with an eigenvalue below this counts as not positive definite."""


class _ToCome(NamedTuple):
    """What a deviation d = (x, y, t) of a state adds to J from its stage on: g'd + d'H d / 2.

    The slope of J is counted by the controls: g comes only from later changes of theirs.
    """

    gx: float
    gy: float
    gt: float
    xx: float
    xy: float
    xt: float
    yy: float
    yt: float
    tt: float


class _ByChange(NamedTuple):
    """What a change u = (s, r) of its speed and yaw rate adds to that: g'u + u'H u / 2 + u'M d."""

    gs: float
    gr: float
    ss: float
    sr: float
    rr: float
    sx: float
    sy: float
    st: float
    rx: float
    ry: float
    rt: float


@inlined
def newton_step(
    problem: Problem, point: Point, curvature: float
) -> tuple[bool, Float[Array, "stages 2"]]:
    """Minimiser of a quadratic model of J over the free controls, the others held.

    One backward and one forward sweep, linear in the number of stages: Dunn & Bertsekas,
    "Efficient dynamic programming implementations of Newton's method for unconstrained optimal
    control problems", JOTA 63, 1989; Rawlings, Mayne & Diehl, 2017, section 8.8.

    Args:
        problem: What is minimised.
        point: Where the model is taken.
        curvature: Weight of the curvature of the motion in the Hessian: 1 makes it exact, 0
            Gauss-Newton's, which is always positive definite.

    Returns:
        Whether the Hessian is positive definite in the free controls, and the step. If it is not,
        the step is a direction of negative curvature: a unit vector at the last stage that shows
        it, zero before, optimal feedback after.
    """
    feedback = np.empty((len(point.controls), 2, 4))
    definite = _sweep(problem, point, curvature, feedback)
    return definite, _follow(problem, point, feedback)


@inlined
def _sweep(
    problem: Problem, point: Point, curvature: float, feedback: Float[Array, "stages 2 4"]
) -> bool:
    """Minimise the model from the last stage to the first.

    Args:
        problem: What is minimised.
        point: Where the model is taken.
        curvature: As for :func:`newton_step`.
        feedback: Filled in, for each stage: the change of the speed, as a constant and the factors
            of x, y and t, and likewise that of the yaw rate.

    Returns:
        Whether the model has a minimum. If it has none, the feedback is that of the direction.
    """
    weights, free, definite = problem.state_weights, point.free, True
    last = len(free)
    qx, qy, qt = 2.0 * weights[last, 0], 2.0 * weights[last, 1], 2.0 * weights[last, 2]
    to_come = _ToCome(0.0, 0.0, 0.0, qx, 0.0, 0.0, qy, 0.0, qt)
    for k in range(last - 1, -1, -1):
        here, change = _through_motion(problem, point, k, curvature, to_come)
        definite, inverse = _inverse_on(change, free[k, 0], free[k, 1])
        if not definite:
            _show(feedback, k, _least_eigenvector(change, free[k, 0], free[k, 1]))
            break
        to_come = _best(here, change, inverse, feedback, k)
    return definite


@inlined
def _through_motion(
    problem: Problem, point: Point, k: int, curvature: float, ahead: _ToCome
) -> tuple[_ToCome, _ByChange]:
    """What is to come from stage k on, given what is from its end on.

    The products with A = I + [0 0 f; 0 0 g; 0 0 0] and B = [a 0; b 0; 0 dt] are written out. To
    the Hessian belongs the curvature of the motion, sum_i l_i d2f_i, with the costate l of the
    stage's end.
    """
    h, dt, weights, slope = ahead, problem.dt, problem.state_weights, point.gradient
    a, b = point.courses[k, 0], point.courses[k, 1]
    f, g = -point.controls[k, 0] * b, point.controls[k, 0] * a
    lx, ly = curvature * point.costates[k + 1, 0], curvature * point.costates[k + 1, 1]
    sx, sy, st = a * h.xx + b * h.xy, a * h.xy + b * h.yy, a * h.xt + b * h.yt
    rx, ry, rt = dt * h.xt, dt * h.yt, dt * h.tt
    xt, yt = h.xt + f * h.xx + g * h.xy, h.yt + f * h.xy + g * h.yy
    tt = h.tt + f * (h.xt + xt) + g * (h.yt + yt)
    change = _ByChange(
        gs=a * h.gx + b * h.gy + slope[k, 0],
        gr=dt * h.gt + slope[k, 1],
        ss=a * sx + b * sy + 2.0 * problem.control_weights[0],
        sr=dt * st,
        rr=dt * rt + 2.0 * problem.control_weights[1],
        sx=sx,
        sy=sy,
        st=st + f * sx + g * sy + a * ly - b * lx,
        rx=rx,
        ry=ry,
        rt=rt + f * rx + g * ry,
    )
    here = _ToCome(
        gx=h.gx,
        gy=h.gy,
        gt=h.gt + f * h.gx + g * h.gy,
        xx=h.xx + 2.0 * weights[k, 0],
        xy=h.xy,
        xt=xt,
        yy=h.yy + 2.0 * weights[k, 1],
        yt=yt,
        tt=tt + 2.0 * weights[k, 2] + f * ly - g * lx,
    )
    return here, change


@inlined
def _inverse_on(
    u: _ByChange, free_speed: bool, free_rate: bool
) -> tuple[bool, tuple[float, float, float]]:
    """Inverse of the Hessian of the free controls, zero elsewhere.

    Returns:
        Whether it is positive definite there; and the inverse's entries ss, sr and rr.
    """
    ss, rr = u.ss if free_speed else np.inf, u.rr if free_rate else np.inf
    sr = u.sr if free_speed and free_rate else 0.0
    above, over = ss - _LEAST_CURVATURE, rr - _LEAST_CURVATURE
    if not (above > 0.0 and over > 0.0 and above * over >= sr * sr):
        return False, (0.0, 0.0, 0.0)
    if sr == 0.0:
        return True, (1.0 / ss, 0.0, 1.0 / rr)
    scale = 1.0 / (ss * rr - sr * sr)
    return True, (scale * rr, -scale * sr, scale * ss)


@inlined
def _best(
    here: _ToCome,
    u: _ByChange,
    inverse: tuple[float, float, float],
    feedback: Float[Array, "stages 2 4"],
    k: int,
) -> _ToCome:
    """What is to come with the best change of the controls; that is noted in ``feedback``."""
    ss, sr, rr = inverse
    s1, sx = -ss * u.gs - sr * u.gr, -ss * u.sx - sr * u.rx
    sy, st = -ss * u.sy - sr * u.ry, -ss * u.st - sr * u.rt
    r1, rx = -sr * u.gs - rr * u.gr, -sr * u.sx - rr * u.rx
    ry, rt = -sr * u.sy - rr * u.ry, -sr * u.st - rr * u.rt
    feedback[k, 0, 0], feedback[k, 0, 1], feedback[k, 0, 2], feedback[k, 0, 3] = s1, sx, sy, st
    feedback[k, 1, 0], feedback[k, 1, 1], feedback[k, 1, 2], feedback[k, 1, 3] = r1, rx, ry, rt
    return _ToCome(
        gx=here.gx + u.sx * s1 + u.rx * r1,
        gy=here.gy + u.sy * s1 + u.ry * r1,
        gt=here.gt + u.st * s1 + u.rt * r1,
        xx=here.xx + u.sx * sx + u.rx * rx,
        xy=here.xy + u.sx * sy + u.rx * ry,
        xt=here.xt + u.sx * st + u.rx * rt,
        yy=here.yy + u.sy * sy + u.ry * ry,
        yt=here.yt + u.sy * st + u.ry * rt,
        tt=here.tt + u.st * st + u.rt * rt,
    )


@inlined
def _least_eigenvector(u: _ByChange, free_speed: bool, free_rate: bool) -> tuple[float, float]:
    """Unit eigenvector, of the Hessian of the free controls, to its least eigenvalue."""
    if not free_rate:
        return 1.0, 0.0
    if not free_speed:
        return 0.0, 1.0
    least = 0.5 * (u.ss + u.rr) - hypot(0.5 * (u.ss - u.rr), u.sr)
    if u.ss > u.rr:  # of the two formulas, the one that does not cancel
        speed, rate = -u.sr, u.ss - least
    else:
        speed, rate = u.rr - least, -u.sr
    length = max(hypot(speed, rate), 1e-300)
    return speed / length, rate / length


@inlined
def _show(feedback: Float[Array, "stages 2 4"], stage: int, direction: tuple[float, float]) -> None:
    """Leave of the feedback what begins with a given change of one stage's controls."""
    for k in range(len(feedback)):
        for i in range(2):
            feedback[k, i, 0] = direction[i] if k == stage else 0.0
            for j in range(1, 4):
                feedback[k, i, j] = feedback[k, i, j] if k > stage else 0.0


@inlined
def _follow(
    problem: Problem, point: Point, feedback: Float[Array, "stages 2 4"]
) -> Float[Array, "stages 2"]:
    """Roll the feedback out through the linearised motion."""
    controls, courses, dt, law = point.controls, point.courses, problem.dt, feedback
    steps = np.empty((len(controls), 2))
    x = y = t = 0.0
    for k in range(len(controls)):
        speed = law[k, 0, 0] + law[k, 0, 1] * x + law[k, 0, 2] * y + law[k, 0, 3] * t
        rate = law[k, 1, 0] + law[k, 1, 1] * x + law[k, 1, 2] * y + law[k, 1, 3] * t
        steps[k, 0], steps[k, 1] = speed, rate
        x += courses[k, 0] * speed - courses[k, 1] * controls[k, 0] * t
        y += courses[k, 1] * speed + courses[k, 0] * controls[k, 0] * t
        t += dt * rate
    return steps
