"""Path and speeds optimised together for time: direct transcription. Needs the extra ``casadi``."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from types import ModuleType
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference, MissingExtra
from omnidrive.planning import SplinePath
from omnidrive.reference.course import Course
from omnidrive.reference.course_timing import time_course
from omnidrive.reference.limits import LimitRows
from omnidrive.reference.spline_basis import bezier_basis, spline_basis
from omnidrive.reference.timed import TimedReference

_PER_PIECE = 4
"""Intervals on each piece of the spline."""

_PLACES = (0.5 - 0.5 / 3.0**0.5, 0.5 + 0.5 / 3.0**0.5)
"""Where on an interval acceleration limits are kept, as shares of it: the Gauss points."""

_SPREAD = 0.1
"""Weight of uneven control points, in s: time alone leaves their places along the way open."""

_LEAST = 1e-6
"""Least squared speed between the ends, as a share of the guess's greatest."""

_STARTS = 2
"""Guesses that are optimised, if there are not many control points."""

_MANY = 200
"""Control points beyond which one guess is optimised, and the program not written out in scalars:
that takes 2 MB for each, as long as it saves, and is worth it only for several guesses."""

_OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-3,
    "ipopt.max_iter": 200,
}


class Guess(NamedTuple):
    """Where to start, and between what the path may move.

    Attributes:
        path: It keeps the bounds.
        low: Least x and y, in m, and yaw, in rad, of the control points; where a number is given,
            low equals high.
        high: The greatest.
        hull: Least x and y, then greatest, in m, of the Bezier points (see :func:`bezier_basis`).
            None leaves them free.
    """

    path: SplinePath
    low: Float[Array, "points 3"]
    high: Float[Array, "points 3"]
    hull: Float[Array, "bezier 4"] | None = None


class Optimised(NamedTuple):
    """What the optimiser found.

    Attributes:
        reference: The fastest motion along the path.
        path: Its control points are between the guess's bounds.
        source: ``guess``: it is one of the guesses; ``converged``: a local optimum of the
            discretised problem; ``capped``: the solver stopped there before it came to one.
    """

    reference: TimedReference
    path: SplinePath
    source: Literal["guess", "converged", "capped"]


def optimised(guesses: list[Guess], length: float, limits: tuple[LimitRows, ...]) -> Optimised:
    """The fastest of the guesses and of the local optima near the fastest one or two of them.

    Args:
        guesses: Splines of one size, within their bounds.
        length: Of the way, in m: the scale of uneven control points.
        limits: What to keep.

    Raises:
        MissingExtra: CasADi is not installed.
    """
    found = [
        Optimised(time_course(Course.of(guess.path), limits), guess.path, "guess")
        for guess in guesses
    ]
    order = sorted(range(len(guesses)), key=lambda k: found[k].reference.duration)
    held = guesses[0].hull is not None
    transcription = Transcription(len(guesses[0].low), length, limits, held=held)
    for k in order[: 1 if transcription.many else _STARTS]:
        path, converged = transcription.solve(guesses[k], found[k].reference)
        source: Literal["converged", "capped"] = "converged" if converged else "capped"
        with suppress(InvalidReference):  # the solver may end anywhere, also where nothing moves
            found.append(Optimised(time_course(Course.of(path), limits), path, source))
    return min(found, key=lambda each: each.reference.duration)


class Transcription:
    """Minimum time over control points and speeds, for splines of one size.

    Unknowns are the control points and the squared speeds x = (ds/dt)^2 at nodes, linear in s
    between them, as in :class:`TimedReference`. Speed limits hold at nodes, all others at two
    places in every interval; the time is the sum of 2 d / (sqrt(x_k) + sqrt(x_k+1)) over
    intervals of width d (Verscheure et al., "Time-optimal path tracking for robots", IEEE Trans.
    Autom. Control 54, 2009, there for a given path). Solved by IPOPT (Wachter & Biegler, Math.
    Program. 106, 2006), always alike. Between those places limits may be broken: what is found
    is a path, to be timed by :func:`time_course`.

    Args:
        points: Control points of the splines.
        length: Of the way, in m: the scale of uneven control points.
        limits: What to keep.
        held: Whether guesses bound their Bezier points.

    Attributes:
        many: Whether there are so many control points that every guess costs much.

    Raises:
        MissingExtra: CasADi is not installed.
    """

    def __init__(
        self, points: int, length: float, limits: tuple[LimitRows, ...], *, held: bool = False
    ) -> None:
        self.many = points > _MANY
        self._solver, self._low = _program(casadi(), points, length / points, limits, held)

    def solve(self, guess: Guess, timed: TimedReference) -> tuple[SplinePath, bool]:
        """The path to which the solver came from ``guess``, and whether it converged there."""
        points = guess.path.control_points
        speeds = _speeds(timed, len(points) - 3)
        least = _LEAST * float(speeds.max())
        inner = np.maximum(0.8 * speeds[1:-1], 2.0 * least)
        low, high = self._low, np.ones(len(self._low))
        if guess.hull is not None:
            low = np.concatenate([low, guess.hull[:, :2].ravel()])
            high = np.concatenate([high, guess.hull[:, 2:].ravel()])
        result = self._solver(
            x0=np.concatenate([points.ravel(), inner]),
            lbx=np.concatenate([guess.low.ravel(), np.full(len(inner), least)]),
            ubx=np.concatenate([guess.high.ravel(), np.full(len(inner), np.inf)]),
            lbg=low,
            ubg=high,
        )
        found = np.asarray(result["x"]).ravel()[: points.size].reshape(points.shape)
        if not np.isfinite(found).all():
            return guess.path, False
        path = SplinePath(_held_back(points, np.clip(found, guess.low, guess.high), guess.hull))
        return path, bool(self._solver.stats()["success"])


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


def _held_back(
    start: Float[Array, "points 3"],
    found: Float[Array, "points 3"],
    hull: Float[Array, "bezier 4"] | None,
) -> Float[Array, "points 3"]:
    """The farthest from ``start`` toward ``found`` whose Bezier points keep their bounds.

    The solver keeps these up to a tolerance only. What the start breaks itself stays broken.
    """
    if hull is None:
        return found
    basis = bezier_basis(len(start))
    here = basis @ start[:, :2]
    step = basis @ found[:, :2] - here
    room = np.where(step > 0.0, hull[:, 2:] - here, here - hull[:, :2])
    moves = np.abs(step) > 1e-12
    shares = np.maximum(room[moves], 0.0) / np.abs(step)[moves]
    part: Float[Array, "points 3"] = start + min(1.0, shares.min(initial=1.0)) * (found - start)
    return part


def _speeds(timed: TimedReference, pieces: int) -> Float[Array, " nodes"]:
    """A motion's squared speeds at the nodes, s counted in pieces; cut where singular."""
    x = timed.squared_speeds * (pieces / len(timed.course.pieces)) ** 2
    nodes = np.linspace(0.0, 1.0, pieces * _PER_PIECE + 1)
    speeds = np.interp(nodes, np.linspace(0.0, 1.0, len(x)), x)
    cut: Float[Array, " nodes"] = np.minimum(speeds, 10.0 * np.median(speeds))
    return cut


def _program(
    ca: ModuleType, points: int, spacing: float, limits: tuple[LimitRows, ...], held: bool
) -> tuple[Any, Float[Array, " rows"]]:
    """The solver of the nonlinear program, and least values of its rows; the greatest are 1."""
    width, nodes = 1.0 / _PER_PIECE, (points - 3) * _PER_PIECE + 1
    flat, inner = ca.MX.sym("p", 3 * points), ca.MX.sym("x", nodes - 2)
    control = ca.reshape(flat, 3, points)
    x, roots = ca.vertcat(0.0, inner, 0.0), ca.vertcat(0.0, ca.sqrt(inner), 0.0)
    u = (x[1:] - x[:-1]) / (2.0 * width)
    time = ca.sum1(2.0 * width / (roots[:-1] + roots[1:]))
    uneven = control[:, 2:] - 2.0 * control[:, 1:-1] + control[:, :-2]
    speed, change = _limit_functions(ca, limits)
    yaw, slopes, _ = _motion(ca, control, np.arange(nodes) * width)
    squares = speed.map(nodes)(yaw, slopes, x.T)
    shares = []
    for place in _PLACES:
        motion = _motion(ca, control, (np.arange(nodes - 1) + place) * width)
        between = x[:-1] + place * (x[1:] - x[:-1])
        shares.append(ca.vec(change.map(nodes - 1)(*motion, between.T, u.T)))
    rows = ca.vertcat(ca.vec(squares), *shares)
    low = np.full(rows.numel(), -1.0)
    low[: squares.numel()] = -np.inf
    cost = time + _SPREAD / points * ca.sumsqr(uneven) / spacing**2
    if held:
        corners = control[:2, :] @ ca.sparsify(ca.DM(bezier_basis(points)), 1e-12).T
        rows = ca.vertcat(rows, ca.vec(corners))
    problem = {"x": ca.vertcat(flat, inner), "f": cost, "g": rows}
    options = _OPTIONS | {"expand": points <= _MANY}
    return ca.nlpsol("minimum_time", "ipopt", problem, options), low


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
            change = turning if group.kind == "twist rate" else across
            share = rows @ (along * u + change * x)
            shares.append(ca.sumsqr(share) if group.round else share)
    return (
        ca.Function("speed", [yaw, slope, x], [ca.vertcat(ca.SX(0, 1), *squares)]),
        ca.Function("change", [yaw, slope, bend, x, u], [ca.vertcat(*shares)]),
    )


def _motion(ca: ModuleType, control: Any, s: Float[Array, " places"]) -> tuple[Any, Any, Any]:
    """Yaw, slope and bend of the spline at places s, which grows by 1 on every piece."""
    points = control.shape[1]
    basis = spline_basis(points)
    matrices = (basis(s), basis.derivative()(s), basis.derivative(2)(s))
    poses, slopes, bends = (control @ ca.sparsify(ca.DM(m), 1e-12).T for m in matrices)
    return poses[2, :], slopes, bends
