"""Newton step in the controls that no limit holds, by a backward and a forward Riccati sweep."""

from __future__ import annotations

from math import hypot
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.unicycle.problem import Control, UnicycleProblem
from omnidrive.control.nmpc.unicycle.stage_point import StagePoint

_MIN_CURVATURE = 1e-8
"""A control Hessian with an eigenvalue below this counts as not positive definite."""


_CHANGE = np.dtype([(name, "f8") for name in ("constant", "x", "y", "yaw")], align=True)
"""Change of a control: a constant, and the gains on the deviations x, y and yaw of the state."""
_FEEDBACK = np.dtype([("speed", _CHANGE), ("yaw_rate", _CHANGE)], align=True)
"""Changes of the controls of a stage."""


class _CostToGo(NamedTuple):
    """Quadratic cost to go g'd + d'H d / 2 of a deviation d = (x, y, t) of a state; t is the yaw.

    The fields are g = (gx, gy, gt) and the entries of the symmetric H.

    The gradient dJ/du_k of a stage already contains the first-order effect of its controls on all
    later states. Therefore g contains only what the optimal changes of later controls add to it; at
    the last state it is zero.
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


class _ControlModel(NamedTuple):
    """Quadratic model g'u + u'H u / 2 + u'M d of a change u = (s, r) of speed and yaw rate.

    d = (x, y, t) is the deviation of the state at the start of the stage. The fields are
    g = (gs, gr), the entries ss, sr and rr of the symmetric H, and the rows (sx, sy, st) and
    (rx, ry, rt) of M.
    """

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


@compiled
def newton_step(
    problem: UnicycleProblem, point: StagePoint, curvature: float
) -> tuple[bool, Float[Array, "stages 2"]]:
    """Minimise a quadratic model of J over the free controls, with the others fixed.

    One backward and one forward sweep, linear in the number of stages: Dunn & Bertsekas,
    "Efficient dynamic programming implementations of Newton's method for unconstrained optimal
    control problems", JOTA 63, 1989; Rawlings, Mayne & Diehl, 2017, section 8.8.

    Args:
        problem: The problem.
        point: Point of linearisation.
        curvature: Factor of the second derivatives of the motion in the Hessian: 1 is the exact
            Hessian; 0 is the Gauss-Newton Hessian, which is always positive definite.

    Returns:
        Whether the Hessian is positive definite in the free controls, and the step. If it is not,
        the step is a direction of negative curvature: a unit vector at the latest stage whose
        Hessian is not positive definite, zero before that stage, and after it the optimal response
        to the deviation that it causes.
    """
    feedback = np.empty(len(point.controls), _FEEDBACK)
    definite = _backward_sweep(problem, point, curvature, feedback)
    return definite, _forward_sweep(problem, point, feedback)


@compiled
def _backward_sweep(
    problem: UnicycleProblem,
    point: StagePoint,
    curvature: float,
    feedback: Any,
) -> bool:
    """Minimise the quadratic model of J from the last stage to the first.

    Args:
        problem: The problem.
        point: Point of linearisation.
        curvature: As for :func:`newton_step`.
        feedback: Output, for each stage: a record of :data:`_FEEDBACK`.

    Returns:
        Whether the Hessian is positive definite. If not, the feedback yields the direction of
        negative curvature.
    """
    weights, free, definite = problem.state_weights, point.free, True
    last = len(free)
    qx, qy, qt = 2.0 * weights[last, 0], 2.0 * weights[last, 1], 2.0 * weights[last, 2]
    cost_to_go = _CostToGo(0.0, 0.0, 0.0, qx, 0.0, 0.0, qy, 0.0, qt)
    for k in range(last - 1, -1, -1):
        cost_to_go, model = _stage_model(problem, point, k, curvature, cost_to_go)
        definite, inverse = _invert_free(model, free[k, 0], free[k, 1])
        if not definite:
            _mask_feedback(feedback, k, _min_eigenvector(model, free[k, 0], free[k, 1]))
            break
        cost_to_go = _minimise_stage(cost_to_go, model, inverse, feedback[k])
    return definite


@compiled
def _stage_model(
    problem: UnicycleProblem, point: StagePoint, k: int, curvature: float, h: _CostToGo
) -> tuple[_CostToGo, _ControlModel]:
    """Return the quadratic model of stage k, given the cost to go ``h`` of the state at its end.

    The first result contains the terms in the deviation of the state at the start of the stage
    alone, with no change of the controls; the second all terms with a change of the controls.

    The linearised motion is A = I + [0 0 f; 0 0 g; 0 0 0] and B = [a 0; b 0; 0 dt], where (a, b) is
    the derivative of the position by the speed and (f, g) that by the yaw; the products with A and
    B are written out. The Hessian includes the second derivatives of the motion, sum_i l_i d2f_i,
    with the costate l of the state at the stage's end.
    """
    dt, weights, gradient = problem.dt, problem.state_weights, point.gradient
    a, b = point.speed_jacobian[k, 0], point.speed_jacobian[k, 1]
    f, g = -point.controls[k, 0] * b, point.controls[k, 0] * a
    lx, ly = curvature * point.costates[k + 1, 0], curvature * point.costates[k + 1, 1]
    sx, sy, st = a * h.xx + b * h.xy, a * h.xy + b * h.yy, a * h.xt + b * h.yt
    rx, ry, rt = dt * h.xt, dt * h.yt, dt * h.tt
    xt, yt = h.xt + f * h.xx + g * h.xy, h.yt + f * h.xy + g * h.yy
    tt = h.tt + f * (h.xt + xt) + g * (h.yt + yt)
    model = _ControlModel(
        gs=a * h.gx + b * h.gy + gradient[k, 0],
        gr=dt * h.gt + gradient[k, 1],
        ss=a * sx + b * sy + 2.0 * problem.control_weights.speed,
        sr=dt * st,
        rr=dt * rt + 2.0 * problem.control_weights.yaw_rate,
        sx=sx,
        sy=sy,
        st=st + f * sx + g * sy + a * ly - b * lx,
        rx=rx,
        ry=ry,
        rt=rt + f * rx + g * ry,
    )
    cost_to_go = _CostToGo(
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
    return cost_to_go, model


@compiled
def _invert_free(
    u: _ControlModel, free_speed: bool, free_rate: bool
) -> tuple[bool, tuple[float, float, float]]:
    """Invert the Hessian of the free controls of a stage; entries of fixed controls are zero.

    Returns:
        Whether it is positive definite; and the entries ss, sr and rr of the inverse.
    """
    ss, rr = u.ss if free_speed else np.inf, u.rr if free_rate else np.inf
    sr = u.sr if free_speed and free_rate else 0.0
    ss_margin, rr_margin = ss - _MIN_CURVATURE, rr - _MIN_CURVATURE
    if not (ss_margin > 0.0 and rr_margin > 0.0 and ss_margin * rr_margin >= sr * sr):
        return False, (0.0, 0.0, 0.0)
    if sr == 0.0:
        return True, (1.0 / ss, 0.0, 1.0 / rr)
    scale = 1.0 / (ss * rr - sr * sr)
    return True, (scale * rr, -scale * sr, scale * ss)


@compiled
def _minimise_stage(
    h: _CostToGo,
    u: _ControlModel,
    inverse: tuple[float, float, float],
    feedback: Any,
) -> _CostToGo:
    """Return the cost to go of a stage with its optimal control change, stored in ``feedback``.

    Args:
        h: Terms in the deviation of the state alone.
        u: Terms with a change of the controls.
        inverse: Entries ss, sr and rr of the inverse of the Hessian of the free controls.
        feedback: Output: the changes of the controls, a record of :data:`_FEEDBACK`.
    """
    ss, sr, rr = inverse
    s1, sx = -ss * u.gs - sr * u.gr, -ss * u.sx - sr * u.rx
    sy, st = -ss * u.sy - sr * u.ry, -ss * u.st - sr * u.rt
    r1, rx = -sr * u.gs - rr * u.gr, -sr * u.sx - rr * u.rx
    ry, rt = -sr * u.sy - rr * u.ry, -sr * u.st - rr * u.rt
    _set_change(feedback.speed, s1, sx, sy, st)
    _set_change(feedback.yaw_rate, r1, rx, ry, rt)
    return _CostToGo(
        gx=h.gx + u.sx * s1 + u.rx * r1,
        gy=h.gy + u.sy * s1 + u.ry * r1,
        gt=h.gt + u.st * s1 + u.rt * r1,
        xx=h.xx + u.sx * sx + u.rx * rx,
        xy=h.xy + u.sx * sy + u.rx * ry,
        xt=h.xt + u.sx * st + u.rx * rt,
        yy=h.yy + u.sy * sy + u.ry * ry,
        yt=h.yt + u.sy * st + u.ry * rt,
        tt=h.tt + u.st * st + u.rt * rt,
    )


@compiled
def _min_eigenvector(u: _ControlModel, free_speed: bool, free_rate: bool) -> Control:
    """Return the unit eigenvector of the smallest eigenvalue of the free controls' Hessian."""
    if not free_rate:
        return Control(1.0, 0.0)
    if not free_speed:
        return Control(0.0, 1.0)
    eigenvalue = 0.5 * (u.ss + u.rr) - hypot(0.5 * (u.ss - u.rr), u.sr)
    if u.ss > u.rr:  # of the two formulas for it, the one without cancellation
        speed, rate = -u.sr, u.ss - eigenvalue
    else:
        speed, rate = u.rr - eigenvalue, -u.sr
    length = max(hypot(speed, rate), 1e-300)
    return Control(speed / length, rate / length)


@compiled
def _set_change(change: Any, constant: float, x: float, y: float, yaw: float) -> None:
    """Set a record of :data:`_CHANGE`."""
    change.constant, change.x, change.y, change.yaw = constant, x, y, yaw


@compiled
def _mask_feedback(feedback: Any, stage: int, direction: Control) -> None:
    """Replace the feedback up to ``stage``, without gains: zero before it, ``direction`` at it."""
    for k in range(stage):
        _set_change(feedback[k].speed, 0.0, 0.0, 0.0, 0.0)
        _set_change(feedback[k].yaw_rate, 0.0, 0.0, 0.0, 0.0)
    _set_change(feedback[stage].speed, direction.speed, 0.0, 0.0, 0.0)
    _set_change(feedback[stage].yaw_rate, direction.yaw_rate, 0.0, 0.0, 0.0)
    for k in range(stage + 1, len(feedback)):
        feedback[k].speed.constant = feedback[k].yaw_rate.constant = 0.0


@compiled
def _change_of(change: Any, x: float, y: float, yaw: float) -> float:
    """Return the change of a control with a deviation of the state."""
    return float(change.constant + change.x * x + change.y * y + change.yaw * yaw)


@compiled
def _forward_sweep(
    problem: UnicycleProblem, point: StagePoint, feedback: Any
) -> Float[Array, "stages 2"]:
    """Apply the feedback along the linearised motion; return the changes of the controls."""
    controls, jacobian, dt = point.controls, point.speed_jacobian, problem.dt
    steps = np.empty((len(controls), 2))
    x = y = t = 0.0  # deviation of the state; t is the yaw
    for k in range(len(controls)):
        speed = _change_of(feedback[k].speed, x, y, t)
        rate = _change_of(feedback[k].yaw_rate, x, y, t)
        steps[k, 0], steps[k, 1] = speed, rate
        x += jacobian[k, 0] * speed - jacobian[k, 1] * controls[k, 0] * t
        y += jacobian[k, 1] * speed + jacobian[k, 0] * controls[k, 0] * t
        t += dt * rate
    return steps
