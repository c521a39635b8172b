"""Optimisation of path and speeds for time, by direct transcription; needs the extra ``casadi``."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from types import ModuleType
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference, MissingExtra
from omnidrive.planning import SplinePath
from omnidrive.planning.deadline import Deadline
from omnidrive.reference.path_optimisation.spline_basis import bezier_basis, spline_basis
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.piecewise_path import PiecewisePath
from omnidrive.reference.timing.time_parameterization import time_optimal_reference
from omnidrive.reference.timing.timed_reference import TimedReference

PER_PIECE = 4
"""Intervals on each piece of the spline."""

GAUSS_POINTS = (0.5 - 0.5 / 3.0**0.5, 0.5 + 0.5 / 3.0**0.5)
"""Collocation points of the acceleration limits, as shares of an interval."""

_SPREAD = 0.1
"""Weight of uneven control points, in s; time alone does not determine their spacing."""

_MIN = 1e-6
"""Lower bound of the squared speeds between the ends, as a share of the guess's largest."""

_STARTS = 2
"""Number of guesses that are optimised for splines that are not large."""

_LARGE = 200
"""Number of control points above which a spline counts as large. Then only one guess is optimised,
and the program is not expanded into scalar operations: the expansion takes 2 MB per control point
and as much time as it saves, and pays only for several guesses."""

_OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-3,
    "ipopt.max_iter": 200,
}


class InitialGuess(NamedTuple):
    """Initial path of the optimisation, and the bounds of its control points.

    Attributes:
        path: Path within the bounds.
        low: Lower bounds of x and y, in m, and yaw, in rad, of the control points; where a value
            is prescribed, both bounds are equal.
        high: Upper bounds.
        hull: Lower bounds of x and y, then upper bounds, in m, of the Bezier points (see
            :func:`bezier_basis`). None: no bounds.
    """

    path: SplinePath
    low: Float[Array, "points 3"]
    high: Float[Array, "points 3"]
    hull: Float[Array, "bezier 4"] | None = None


class OptimisedPath(NamedTuple):
    """Result of the optimisation.

    Attributes:
        reference: Fastest motion along the path.
        path: Path with control points within the bounds of the guess.
        source: Origin of the path. ``guess``: one of the guesses; ``converged``: a local optimum of
            the discretised problem; ``capped``: the solver stopped before convergence.
    """

    reference: TimedReference
    path: SplinePath
    source: Literal["guess", "converged", "capped"]


def optimise_path(
    guesses: list[InitialGuess],
    length: float,
    limits: tuple[LimitRows, ...],
    deadline: Deadline | None = None,
) -> OptimisedPath:
    """Return the fastest of the guesses and of the local optima from the fastest one or two.

    Args:
        guesses: Splines with the same number of control points, within their bounds.
        length: Length of the path, in m, which scales the weight of uneven control points.
        limits: Limits of the motion.
        deadline: Time limit; None: no limit.

    Raises:
        MissingExtra: CasADi is not installed.
    """
    found = [
        OptimisedPath(
            time_optimal_reference(PiecewisePath.of(guess.path), limits), guess.path, "guess"
        )
        for guess in guesses
    ]
    order = sorted(range(len(guesses)), key=lambda k: found[k].reference.duration)
    bounded = guesses[0].hull is not None
    points = len(guesses[0].low)
    tried = order[: 1 if points > _LARGE else _STARTS]
    transcription = Transcription(
        points, length, limits, bounded=bounded,
        time_limit=None if deadline is None else deadline.left,
    )  # fmt: skip
    for k in tried:
        if deadline is not None and deadline.remaining <= 0.0:
            break
        path, converged = transcription.solve(guesses[k], found[k].reference)
        source: Literal["converged", "capped"] = "converged" if converged else "capped"
        with suppress(InvalidReference):  # the solver may return a path that does not move
            reference = time_optimal_reference(PiecewisePath.of(path), limits)
            found.append(OptimisedPath(reference, path, source))
    return min(found, key=lambda each: each.reference.duration)


class Transcription:
    """Minimum-time problem over control points and speeds, for one number of control points.

    The unknowns are the control points and the squared speeds x = (ds/dt)^2 at nodes, linear in s
    between nodes as in :class:`TimedReference`. Speed limits hold at the nodes, all other limits at
    the two Gauss points of each interval. The duration is the sum of
    2 d / (sqrt(x_k) + sqrt(x_k+1)) over intervals of width d (Verscheure et al., "Time-optimal path
    tracking for robots", IEEE Trans. Autom. Control 54, 2009, there for a given path). IPOPT
    (Wachter & Biegler, Math. Program. 106, 2006) solves the problem, deterministically. Limits may
    be violated between the collocation points: the result is a path, whose timing
    :func:`time_optimal_reference` computes.

    Args:
        points: Number of control points.
        length: Length of the path, in m, which scales the weight of uneven control points.
        limits: Limits of the motion.
        bounded: Whether the guesses bound their Bezier points.
        time_limit: Returns the time limit of each solution, in s; None: no limit.

    Raises:
        MissingExtra: CasADi is not installed.
    """

    def __init__(
        self,
        points: int,
        length: float,
        limits: tuple[LimitRows, ...],
        *,
        bounded: bool = False,
        time_limit: Callable[[], float] | None = None,
    ) -> None:
        self._points, self._time_limit = points, time_limit
        self._solver: Any = None
        self._problem, self._low = _program(casadi(), points, length / points, limits, bounded)

    def _made(self) -> Any:
        """Return the solver, a new one if its time is limited."""
        options = _OPTIONS | {"expand": self._points <= _LARGE}
        if self._time_limit is not None:
            options |= {"ipopt.max_wall_time": self._time_limit()}
        elif self._solver is not None:
            return self._solver
        self._solver = casadi().nlpsol("minimum_time", "ipopt", self._problem, options)
        return self._solver

    def solve(self, guess: InitialGuess, timed: TimedReference) -> tuple[SplinePath, bool]:
        """Return the solver's path from ``guess``, and whether it converged.

        Args:
            guess: Initial path and bounds.
            timed: Motion along the initial path, which gives the initial speeds.
        """
        points = guess.path.control_points
        speeds = _speeds(timed, len(points) - 3)
        minimum = _MIN * float(speeds.max())
        inner = np.maximum(0.8 * speeds[1:-1], 2.0 * minimum)
        low, high = self._low, np.ones(len(self._low))
        if guess.hull is not None:
            low = np.concatenate([low, guess.hull[:, :2].ravel()])
            high = np.concatenate([high, guess.hull[:, 2:].ravel()])
        solver = self._made()
        result = solver(
            x0=np.concatenate([points.ravel(), inner]),
            lbx=np.concatenate([guess.low.ravel(), np.full(len(inner), minimum)]),
            ubx=np.concatenate([guess.high.ravel(), np.full(len(inner), np.inf)]),
            lbg=low,
            ubg=high,
        )
        found = np.asarray(result["x"]).ravel()[: points.size].reshape(points.shape)
        if not np.isfinite(found).all():
            return guess.path, False
        path = SplinePath(_limit_step(points, np.clip(found, guess.low, guess.high), guess.hull))
        return path, bool(solver.stats()["success"])


def casadi(
    purpose: str = "free headings and timing 'minimum-time' need",
    instead: str = ", or choose timing 'limits' with another heading",
) -> ModuleType:
    """Import CasADi.

    Args:
        purpose: What needs it, for the message.
        instead: Another way out, for the message.

    Raises:
        MissingExtra: CasADi is not installed.
    """
    try:
        return import_module("casadi")
    except ImportError as error:
        raise MissingExtra(
            f"{purpose} CasADi, which is not installed: pip install casadi{instead}"
        ) from error


def _limit_step(
    start: Float[Array, "points 3"],
    found: Float[Array, "points 3"],
    hull: Float[Array, "bezier 4"] | None,
) -> Float[Array, "points 3"]:
    """Return the point farthest from ``start`` towards ``found`` with Bezier points in bounds.

    The solver satisfies these bounds up to a tolerance only. Bounds that ``start`` violates remain
    violated.
    """
    if hull is None:
        return found
    basis = bezier_basis(len(start))
    here = basis @ start[:, :2]
    step = basis @ found[:, :2] - here
    slack = np.where(step > 0.0, hull[:, 2:] - here, here - hull[:, :2])
    moves = np.abs(step) > 1e-12
    shares = np.maximum(slack[moves], 0.0) / np.abs(step)[moves]
    part: Float[Array, "points 3"] = start + min(1.0, shares.min(initial=1.0)) * (found - start)
    return part


def _speeds(timed: TimedReference, pieces: int) -> Float[Array, " nodes"]:
    """Return the squared speeds of a motion at the nodes, limited where they are singular."""
    x = timed.squared_speeds * (pieces / len(timed.path.pieces)) ** 2
    nodes = np.linspace(0.0, 1.0, pieces * PER_PIECE + 1)
    speeds = np.interp(nodes, np.linspace(0.0, 1.0, len(x)), x)
    limited: Float[Array, " nodes"] = np.minimum(speeds, 10.0 * np.median(speeds))
    return limited


def _program(
    ca: ModuleType, points: int, spacing: float, limits: tuple[LimitRows, ...], bounded: bool
) -> tuple[dict[str, Any], Float[Array, " rows"]]:
    """Return the nonlinear program, and the lower bounds of its constraints.

    The upper bounds are 1.
    """
    width, nodes = 1.0 / PER_PIECE, (points - 3) * PER_PIECE + 1
    flat, inner = ca.MX.sym("p", 3 * points), ca.MX.sym("x", nodes - 2)
    control = ca.reshape(flat, 3, points)
    x, roots = ca.vertcat(0.0, inner, 0.0), ca.vertcat(0.0, ca.sqrt(inner), 0.0)
    u = (x[1:] - x[:-1]) / (2.0 * width)
    time = ca.sum1(2.0 * width / (roots[:-1] + roots[1:]))
    uneven = control[:, 2:] - 2.0 * control[:, 1:-1] + control[:, :-2]
    speed, change = limit_functions(ca, limits)
    yaw, first, _ = spline_motion(ca, control, np.arange(nodes) * width)
    squares = speed.map(nodes)(yaw, first, x.T)
    shares = []
    for point in GAUSS_POINTS:
        motion = spline_motion(ca, control, (np.arange(nodes - 1) + point) * width)
        between = x[:-1] + point * (x[1:] - x[:-1])
        shares.append(ca.vec(change.map(nodes - 1)(*motion, between.T, u.T)))
    rows = ca.vertcat(ca.vec(squares), *shares)
    low = np.full(rows.numel(), -1.0)
    low[: squares.numel()] = -np.inf
    cost = time + _SPREAD / points * ca.sumsqr(uneven) / spacing**2
    if bounded:
        corners = control[:2, :] @ ca.sparsify(ca.DM(bezier_basis(points)), 1e-12).T
        rows = ca.vertcat(rows, ca.vec(corners))
    problem = {"x": ca.vertcat(flat, inner), "f": cost, "g": rows}
    return problem, low


def limit_functions(ca: ModuleType, limits: tuple[LimitRows, ...]) -> tuple[Any, Any]:
    """Return functions for the squared usage of speed limits, and the usage of all others.

    Their arguments are yaw, first derivative (, second derivative), x and u at one point. See
    :func:`~omnidrive.reference.timing.piecewise_path.body_derivatives` for the formulas.
    """
    yaw, x, u = ca.SX.sym("yaw"), ca.SX.sym("x"), ca.SX.sym("u")
    first, second = ca.SX.sym("first", 3), ca.SX.sym("second", 3)
    c, s = ca.cos(yaw), ca.sin(yaw)
    zero = ca.SX(1, 1)
    into_body = ca.vertcat(
        ca.horzcat(c, s, zero), ca.horzcat(-s, c, zero), ca.horzcat(zero, zero, 1.0)
    )
    along, across = into_body @ first, into_body @ second
    turning = across + first[2] * ca.vertcat(along[1], -along[0], 0.0)
    squares, shares = [], []
    for group in limits:
        rows = ca.DM(group.rows)
        if group.kind == "speed":
            square = (rows @ along) ** 2 * x
            squares.append(ca.sum1(square) if group.euclidean else square)
        else:
            change = turning if group.kind == "twist rate" else across
            share = rows @ (along * u + change * x)
            shares.append(ca.sumsqr(share) if group.euclidean else share)
    return (
        ca.Function("speed", [yaw, first, x], [ca.vertcat(ca.SX(0, 1), *squares)]),
        ca.Function("change", [yaw, first, second, x, u], [ca.vertcat(*shares)]),
    )


def spline_motion(ca: ModuleType, control: Any, s: Float[Array, " n"]) -> tuple[Any, Any, Any]:
    """Return yaw, first and second derivatives of the spline at parameters s."""
    points = control.shape[1]
    basis = spline_basis(points)
    matrices = (basis(s), basis.derivative()(s), basis.derivative(2)(s))
    poses, first, second = (control @ ca.sparsify(ca.DM(m), 1e-12).T for m in matrices)
    return poses[2, :], first, second
