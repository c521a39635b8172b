"""Path and speeds optimised together for time: direct transcription. Needs the extra ``casadi``."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from omnidrive.errors import MissingExtra
from omnidrive.planning import SplinePath
from omnidrive.reference.course import Course
from omnidrive.reference.course_timing import time_course
from omnidrive.reference.limits import LimitRows

Array = np.ndarray

_PER_PIECE = 4
"""Nodes on each piece of the spline."""

_SPREAD = 1e-3
"""Weight of uneven control points, in s: time alone leaves their places along the way open."""

_LEAST = 1e-6
"""Least squared speed between the ends, as a share of the guess's greatest."""

_OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-5,
    "ipopt.max_iter": 300,
    "ipopt.mu_strategy": "adaptive",
}


class Optimised(NamedTuple):
    """What the optimiser found.

    Attributes:
        path: The best path that it came to, perhaps a poor one.
        converged: Whether it is a local optimum of the discretised problem.
    """

    path: SplinePath
    converged: bool


def optimised(
    guess: SplinePath,
    low: Float[Array, "points 3"],
    high: Float[Array, "points 3"],
    limits: tuple[LimitRows, ...],
) -> Optimised:
    """Control points between ``low`` and ``high`` that make the motion from rest to rest fastest.

    Unknowns are the control points and the squared speeds x = (ds/dt)^2 at nodes, linear in s
    between them, as in :class:`TimedReference`. Every limit holds at both ends of every interval;
    the time is the sum of 2 d / (sqrt(x_k) + sqrt(x_k+1)) over intervals of width d
    (Verscheure et al., "Time-optimal path tracking for robots", IEEE Trans. Autom. Control 54,
    2009, eq. 17, there for a given path). Solved by IPOPT (Wachter & Biegler, Math. Program. 106,
    2006), deterministic.

    Args:
        guess: Where to start; its control points are moved between the bounds.
        low: Least x, y (m) and yaw (rad) of each control point.
        high: Greatest; equal to ``low`` where a number is given.
        limits: What to keep.

    Raises:
        MissingExtra: CasADi is not installed.
    """
    ca = casadi()
    points = np.clip(guess.control_points, low, high)
    speeds = _speeds(SplinePath(points), limits)
    least = _LEAST * float(speeds.max())
    unknowns = [points.ravel(), np.maximum(0.8 * speeds[1:-1], 2.0 * least)]
    program = _program(ca, points, limits)
    result = program["solve"](
        x0=np.concatenate(unknowns),
        lbx=np.concatenate([low.ravel(), np.full(len(speeds) - 2, least)]),
        ubx=np.concatenate([high.ravel(), np.full(len(speeds) - 2, np.inf)]),
        lbg=program["low"],
        ubg=1.0,
    )
    found = np.asarray(result["x"]).ravel()[: points.size].reshape(points.shape)
    converged = bool(program["solve"].stats()["success"]) and bool(np.isfinite(found).all())
    found = np.where(np.isfinite(found), found, points)
    return Optimised(SplinePath(np.clip(found, low, high)), converged)


def casadi() -> ModuleType:
    """The library.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return import_module("casadi")
    except ImportError as error:
        raise MissingExtra(
            "free headings and timing 'minimum-time' need CasADi, which is not installed: "
            "pip install 'omnidrive[casadi]', or choose timing 'limits' with another heading"
        ) from error


def _speeds(path: SplinePath, limits: tuple[LimitRows, ...]) -> Float[Array, " nodes"]:
    """Squared speeds at the nodes in the fastest motion along ``path``, cut where singular."""
    exact = time_course(Course.of(path), limits)
    pieces = len(path.control_points) - 3
    x = exact.squared_speeds * (pieces / len(exact.course.pieces)) ** 2
    nodes = np.linspace(0.0, 1.0, pieces * _PER_PIECE + 1)
    speeds: Float[Array, " nodes"] = np.interp(nodes, np.linspace(0.0, 1.0, len(x)), x)
    return np.minimum(speeds, 10.0 * np.median(speeds))


def _program(
    ca: ModuleType, guess: Float[Array, "points 3"], limits: tuple[LimitRows, ...]
) -> dict[str, Any]:
    """The nonlinear program and the lower bounds of its constraints; the upper are all 1."""
    points = len(guess)
    basis = [ca.sparsify(ca.DM(matrix)) for matrix in _basis(points)]
    nodes = basis[0].shape[0]
    width = 1.0 / _PER_PIECE
    flat, inner = ca.MX.sym("p", 3 * points), ca.MX.sym("x", nodes - 2)
    control = ca.reshape(flat, 3, points)
    poses, slopes, bends = (control @ matrix.T for matrix in basis)
    x = ca.vertcat(0.0, inner, 0.0)
    u = (x[1:] - x[:-1]) / (2.0 * width)
    roots = ca.vertcat(0.0, ca.sqrt(inner), 0.0)
    time = ca.sum1(2.0 * width / (roots[:-1] + roots[1:]))
    spacing = np.linalg.norm(np.diff(guess, axis=0), axis=1).mean()
    uneven = ca.sumsqr(control[:, 2:] - 2.0 * control[:, 1:-1] + control[:, :-2]) / spacing**2
    speed, change = _limit_functions(ca, limits)
    left, right = slice(0, nodes - 1), slice(1, nodes)
    squares = speed.map(nodes)(poses[2, :], slopes, x.T)
    held = [
        change.map(nodes - 1)(poses[2, side], slopes[:, side], bends[:, side], x[side].T, u.T)
        for side in (left, right)
    ]
    lows = [np.full(squares.numel(), -np.inf), *(np.full(h.numel(), -1.0) for h in held)]
    problem = {
        "x": ca.vertcat(flat, inner),
        "f": time + _SPREAD / points * uneven,
        "g": ca.vertcat(ca.vec(squares), *map(ca.vec, held)),
    }
    solve = ca.nlpsol("minimum_time", "ipopt", problem, _OPTIONS)
    return {"solve": solve, "low": np.concatenate(lows)}


def _limit_functions(ca: ModuleType, limits: tuple[LimitRows, ...]) -> tuple[Any, Any]:
    """Squared shares of speed limits, and shares of all others, at one place.

    Arguments: yaw, slope, (bend,) x and u; see :meth:`Course.body` for the formulas.
    """
    yaw, x, u = ca.SX.sym("yaw"), ca.SX.sym("x"), ca.SX.sym("u")
    slope, bend = ca.SX.sym("slope", 3), ca.SX.sym("bend", 3)
    c, s = ca.cos(yaw), ca.sin(yaw)
    zero = ca.SX(1, 1)
    into_body = ca.vertcat(
        ca.horzcat(c, s, zero), ca.horzcat(-s, c, zero), ca.horzcat(zero, zero, 1.0)
    )
    along, across = into_body @ slope, into_body @ bend
    turning = across + slope[2] * ca.vertcat(along[1], -along[0], 0.0)
    squares, shares = [], []
    for group in limits:
        rows = ca.DM(group.rows)
        if group.kind == "speed":
            square = (rows @ along) ** 2 * x
            squares.append(ca.sum1(square) if group.round else square)
        else:
            shares.append(
                rows @ (along * u + (turning if group.kind == "twist rate" else across) * x)
            )
    return (
        ca.Function("speed", [yaw, slope, x], [ca.vertcat(ca.SX(0, 1), *squares)]),
        ca.Function("change", [yaw, slope, bend, x, u], [ca.vertcat(*shares)]),
    )


def _basis(points: int) -> list[Any]:
    """Matrices from control points to poses, slopes and bends by s at the nodes."""
    pieces = points - 3
    knots = np.concatenate([[0.0] * 3, np.arange(pieces + 1.0), [float(pieces)] * 3])
    spline = BSpline(knots, np.eye(points), 3)
    s = np.arange(pieces * _PER_PIECE + 1) / _PER_PIECE
    matrices = (spline(s), spline.derivative()(s), spline.derivative(2)(s))
    return [np.where(np.abs(m) > 1e-12, m, 0.0) for m in matrices]
