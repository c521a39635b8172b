"""Nonlinear program of a minimum-time motion through waypoints; needs the extra ``casadi``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.planning import SplinePath
from omnidrive.planning.deadline import Deadline
from omnidrive.reference.path_optimisation.spline_basis import bezier_basis, spline_basis
from omnidrive.reference.path_optimisation.transcription import (
    GAUSS_POINTS,
    PER_PIECE,
    casadi,
    limit_functions,
    spline_motion,
)
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.timed_reference import TimedReference
from omnidrive.reference.waypoint_motion.constraints import Constraint
from omnidrive.reference.waypoint_motion.initial_path import InitialPath, held_yaw
from omnidrive.reference.waypoint_motion.layout import Layout, Part
from omnidrive.reference.waypoint_motion.regions import Disc, separation
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint

_SPREAD = 0.1
"""Weight of uneven control points, in s; time alone does not determine their spacing."""

_TURN = 1e-3
"""Weight of turns, in s/rad^2; where no limit depends on headings, time does not determine them."""

_MIN = 1e-6
"""Lower bound of the squared speeds between stops, as a share of the guess's largest."""

_PENALTY = 1e3
"""Cost of the violation of a constraint in elastic mode, in s/m or s/rad."""

_POINTING_SHARE = 0.98
"""Share of the tolerance of headings that the collocation points use."""

_OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-3,
    "ipopt.constr_viol_tol": 1e-6,
    "ipopt.acceptable_tol": 1e-2,
    "ipopt.acceptable_iter": 6,
    "ipopt.acceptable_constr_viol_tol": 1e-4,
    "ipopt.max_iter": 120,
    "ipopt.mu_init": 1e-3,  # the initial speeds are optimal along the initial path
}


class Problem(NamedTuple):
    """Waypoints with constraints, and limits as rows.

    Attributes:
        waypoints: The waypoints.
        constraints: Constraints on poses.
        limits: Limits of the whole motion.
        section_limits: Limits of each section.
        body_radius: Radius of the robot, in m.
    """

    waypoints: tuple[MotionWaypoint, ...]
    constraints: tuple[Constraint, ...]
    limits: tuple[LimitRows, ...]
    section_limits: tuple[tuple[MotionSection, tuple[LimitRows, ...]], ...]
    body_radius: float


class Solution(NamedTuple):
    """Splines found by the solver.

    Attributes:
        paths: One spline for each pair of neighbouring stops.
        converged: Whether the solver converged.
        violations: Violation of each constraint that elastic mode needs, in m or rad.
    """

    paths: tuple[SplinePath, ...]
    converged: bool
    violations: Float[Array, " constraints"]


class _Spline(NamedTuple):
    """Symbols of one spline: control points, squared speeds and their rates at all nodes."""

    control: Any
    speeds: Any
    rates: Any


class Program:
    """Minimum-time problem through waypoints from one initial path.

    The unknowns are the control points and squared speeds of
    :class:`~omnidrive.reference.path_optimisation.transcription.Transcription` for each spline from
    stop to stop. Limits of a section hold at the nodes and Gauss points of its pieces. The Bezier
    points of a piece are inside each region to keep in; a line between them and each region to keep
    out, whose direction is an unknown, separates their hulls, so that the whole piece is outside.
    Every constraint on poses may be violated by an unknown that is 0, or has a large cost in
    elastic mode.

    Raises:
        MissingExtra: CasADi is not installed.
    """

    def __init__(
        self,
        problem: Problem,
        guess: InitialPath,
        timed: TimedReference,
        deadline: Deadline | None = None,
    ) -> None:
        self._ca = casadi("a motion through waypoints needs", "")
        self._problem, self._guess = problem, guess
        self._unknowns: list[Any] = []
        self._values: list[Array] = []
        self._bounds: list[tuple[Array, Array]] = []
        self._rows: list[Any] = []
        self._row_bounds: list[tuple[Array, Array]] = []
        self._slacks = self._ca.MX.sym("slacks", len(problem.constraints))
        layout = guess.layout
        cost = self._ca.MX(0.0)
        splines = []
        for index in range(len(guess.paths)):
            spline, time = self._add_spline(index, timed)
            splines.append(spline)
            cost += time
            self._add_waypoints(index, spline)
            self._add_limits(problem.limits, Part(index, 0, int(layout.pieces[index])), spline)
        self._add_free_yaws(splines)
        for section, limits in problem.section_limits:
            for part in layout.parts(section.first, section.last):
                self._add_limits(limits, part, splines[part.spline])
        for number, constraint in enumerate(problem.constraints):
            section = constraint.section
            for part in layout.parts(section.first, section.last):
                self._add_constraint(constraint, number, part, splines[part.spline])
        cost += _PENALTY * self._ca.sum1(self._slacks)
        nlp = {
            "x": self._ca.vertcat(*self._unknowns, self._slacks),
            "f": cost,
            "g": self._ca.vertcat(*self._rows),
        }
        limit = {} if deadline is None else {"ipopt.max_wall_time": deadline.left()}
        self._solver = self._ca.nlpsol("waypoints", "ipopt", nlp, _OPTIONS | limit)

    def solve(self, *, elastic: bool = False) -> Solution:
        """Return the motion that the solver finds.

        Args:
            elastic: Whether constraints on poses may be violated at a cost.
        """
        count = len(self._problem.constraints)
        low, high = (np.concatenate([each[k] for each in self._bounds]) for k in (0, 1))
        row_low, row_high = (np.concatenate([each[k] for each in self._row_bounds]) for k in (0, 1))
        start = np.full(count, 0.1 if elastic else 0.0)
        result = self._solver(
            x0=np.concatenate([*self._values, start]),
            lbx=np.concatenate([low, np.zeros(count)]),
            ubx=np.concatenate([high, np.full(count, np.inf if elastic else 0.0)]),
            lbg=row_low,
            ubg=row_high,
        )
        found = np.asarray(result["x"]).ravel()
        if not np.isfinite(found).all():
            return Solution(self._guess.paths, False, np.zeros(count))
        paths, at = [], 0
        for path in self._guess.paths:
            points = path.control_points
            paths.append(SplinePath(found[at : at + points.size].reshape(points.shape)))
            pieces = len(points) - 3
            at += points.size + pieces * PER_PIECE - 1
        converged = bool(self._solver.stats()["success"])
        return Solution(tuple(paths), converged, found[len(found) - count :])

    def _unknown(self, name: str, value: Array, low: Array, high: Array) -> Any:
        symbol = self._ca.MX.sym(name, len(value))
        self._unknowns.append(symbol)
        self._values.append(value)
        self._bounds.append((low, high))
        return symbol

    def _row(self, rows: Any, low: float, high: float) -> None:
        rows = self._ca.vec(rows)
        count = rows.numel()
        if count:
            self._rows.append(rows)
            self._row_bounds.append((np.full(count, low), np.full(count, high)))

    def _add_spline(self, index: int, timed: TimedReference) -> tuple[_Spline, Any]:
        """Add the unknowns of a spline, and return it with its cost."""
        ca, points = self._ca, self._guess.paths[index].control_points
        free = np.full(points.size, np.inf)
        count, nodes = len(points), (len(points) - 3) * PER_PIECE + 1
        low, high = -free, free.copy()
        for run in self._guess.held[index]:
            yaw = held_yaw(self._guess, index, run)
            if yaw is not None:
                inside = slice(3 * run[0] + 2, 3 * run[1] + 3, 3)
                low[inside] = high[inside] = yaw
        control = ca.reshape(self._unknown("p", points.ravel(), low, high), 3, count)
        for first, last in self._guess.held[index]:
            if held_yaw(self._guess, index, (first, last)) is None:
                yaws = control[2, first : last + 1]
                self._row(yaws[1:] - yaws[:-1], 0.0, 0.0)
        speeds = _speeds(timed, self._guess.layout, index)
        minimum = _MIN * float(speeds.max())
        inner = np.maximum(0.8 * speeds[1:-1], 2.0 * minimum)
        x = self._unknown("x", inner, np.full(nodes - 2, minimum), np.full(nodes - 2, np.inf))
        width = 1.0 / PER_PIECE
        speeds = ca.vertcat(0.0, x, 0.0)
        roots = ca.vertcat(0.0, ca.sqrt(x), 0.0)
        rates = (speeds[1:] - speeds[:-1]) / (2.0 * width)
        time = ca.sum1(2.0 * width / (roots[:-1] + roots[1:]))
        uneven = control[:, 2:] - 2.0 * control[:, 1:-1] + control[:, :-2]
        sides = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
        spacing = max(float(sides.sum()) / count, 1e-2)
        turns = control[2, 1:] - control[2, :-1]
        cost = time + _SPREAD / count * ca.sumsqr(uneven) / spacing**2
        cost += _TURN * count * ca.sumsqr(turns)
        return _Spline(control, speeds, rates), cost

    def _add_waypoints(self, index: int, spline: _Spline) -> None:
        """Make a spline pass its waypoints."""
        layout = self._guess.layout
        for k in layout.waypoints(index):
            each, yaw = self._problem.waypoints[k], float(self._guess.yaws[k])
            at = layout.local(index, k)
            if any(low <= at <= high - 2 for low, high in self._guess.held[index]):
                yaw = np.nan  # a bound of the control points
            if not (each.fixed or np.isfinite(yaw)):
                continue
            pose = self._poses(spline, np.array([float(layout.local(index, k))]))
            if each.fixed:
                self._row(pose[:2] - self._ca.DM([each.x, each.y]), 0.0, 0.0)
            if np.isfinite(yaw):
                self._row(pose[2] - yaw, 0.0, 0.0)

    def _add_free_yaws(self, splines: Sequence[_Spline]) -> None:
        """Join splines at stops whose heading or position is free."""
        layout = self._guess.layout
        for index, stop in enumerate(layout.stops[1:-1].tolist()):
            jump = splines[index + 1].control[:, 0] - splines[index].control[:, -1]
            if not np.isfinite(self._guess.yaws[stop]):
                self._row(jump[2], 0.0, 0.0)
            if not self._problem.waypoints[stop].fixed:
                self._row(jump[:2], 0.0, 0.0)

    def _poses(self, spline: _Spline, s: Float[Array, " n"]) -> Any:
        return spline.control @ _basis(self._ca, spline, s)

    def _add_limits(self, limits: tuple[LimitRows, ...], part: Part, spline: _Spline) -> None:
        """Add limits at the nodes and Gauss points of a part of a spline."""
        if not limits:
            return
        ca, width = self._ca, 1.0 / PER_PIECE
        speed, change = limit_functions(ca, limits)
        total = spline.rates.numel()
        nodes = np.arange(part.first * PER_PIECE, part.last * PER_PIECE + 1)
        intervals = nodes[:-1] if len(nodes) > 1 else np.array([nodes[0] - 1, nodes[0]])
        intervals = intervals[(intervals >= 0) & (intervals < total)]
        yaw, first, _ = spline_motion(ca, spline.control, nodes * width)
        low, high = int(nodes[0]), int(nodes[-1])
        squares = speed.map(len(nodes))(yaw, first, spline.speeds[low : high + 1].T)
        self._row(squares, -np.inf, 1.0)
        low, high = int(intervals[0]), int(intervals[-1])
        before, after = spline.speeds[low : high + 1], spline.speeds[low + 1 : high + 2]
        for point in GAUSS_POINTS:
            motion = spline_motion(ca, spline.control, (intervals + point) * width)
            between = before + point * (after - before)
            rates = spline.rates[low : high + 1]
            self._row(change.map(len(intervals))(*motion, between.T, rates.T), -1.0, 1.0)

    def _add_constraint(
        self, constraint: Constraint, number: int, part: Part, spline: _Spline
    ) -> None:
        slack = self._slacks[number]
        if constraint.kind == "point":
            self._add_pointing(constraint.section, slack, part, spline)
            return
        ca, points = self._ca, spline.control.shape[1]
        basis = ca.sparsify(ca.DM(bezier_basis(points)), 1e-12)
        bezier = (spline.control[:2, :] @ basis.T)[:, 3 * part.first : 3 * part.last + 1]
        if constraint.line is not None:
            normal, offset = constraint.line
            off = ca.DM(normal).T @ bezier - offset
            self._row(off - slack, -np.inf, constraint.section.lane)
            self._row(off + slack, -constraint.section.lane, np.inf)
        elif constraint.kind == "keep-in":
            self._add_keep_in(constraint, slack, bezier)
        else:
            self._add_keep_out(constraint, slack, part, bezier)

    def _add_keep_in(self, constraint: Constraint, slack: Any, bezier: Any) -> None:
        ca, region, body = self._ca, constraint.region, self._problem.body_radius
        assert region is not None
        if isinstance(region, Disc):
            away = bezier - ca.DM([region.x, region.y])
            allowed = region.radius - body + slack
            self._row(ca.sum1(away**2) / region.radius - allowed**2 / region.radius, -np.inf, 0.0)
        else:
            for normal, offset in zip(region.normals, region.offsets.tolist(), strict=True):
                self._row(ca.DM(normal).T @ bezier - slack, -np.inf, offset - body)

    def _add_keep_out(self, constraint: Constraint, slack: Any, part: Part, bezier: Any) -> None:
        """Add a separating line for each piece of a part."""
        ca, region = self._ca, constraint.region
        assert region is not None
        control = self._guess.paths[part.spline].control_points
        guess = bezier_basis(len(control)) @ control[:, :2]
        starts = range(part.first, max(part.last, part.first + 1))
        width = 4 if part.last > part.first else 1
        pieces = np.stack([np.resize(guess[3 * k : 3 * k + width], (4, 2)) for k in starts])
        _, normals = separation(region, pieces)
        free = np.full(len(pieces), np.inf)
        angles = self._unknown("a", np.arctan2(normals[:, 1], normals[:, 0]), -free, free)
        supports = (normals @ region.vertices.T).max(axis=1)
        support = self._unknown("h", supports, -free, free)
        normal = ca.horzcat(ca.cos(angles), ca.sin(angles))
        vertices = normal @ ca.DM(region.vertices).T
        self._row(vertices - support, -np.inf, 0.0)
        needed = region.rounding + self._problem.body_radius
        for k in range(len(pieces)):
            points = bezier[:, 3 * k : 3 * k + width]
            self._row(normal[k, :] @ points - support[k] + slack, needed, np.inf)

    def _add_pointing(
        self, section: MotionSection, slack: Any, part: Part, spline: _Spline
    ) -> None:
        ca = self._ca
        assert section.point_at is not None
        nodes = np.arange(part.first * PER_PIECE, part.last * PER_PIECE + 1, dtype=float)
        layout, waypoints = self._guess.layout, self._problem.waypoints
        given = [
            layout.local(part.spline, k) * PER_PIECE
            for k in layout.waypoints(part.spline)
            if waypoints[k].fixed and waypoints[k].yaw is not None
        ]
        s = np.sort(np.concatenate([nodes, *(nodes[:-1] + point for point in GAUSS_POINTS)]))
        s = s[~np.isin(s, given)] / PER_PIECE
        if not len(s):
            return
        poses = self._poses(spline, s)
        x, y = section.point_at
        away_x, away_y = x - poses[0, :], y - poses[1, :]
        yaw = poses[2, :] - section.point_offset
        c, s_ = ca.cos(yaw), ca.sin(yaw)
        error = ca.atan2(s_ * away_x - c * away_y, c * away_x + s_ * away_y)
        tolerance = _POINTING_SHARE * section.point_tolerance
        self._row(error - slack, -np.inf, tolerance)
        self._row(error + slack, -tolerance, np.inf)


def _basis(ca: Any, spline: _Spline, s: Float[Array, " n"]) -> Any:
    return ca.sparsify(ca.DM(spline_basis(spline.control.shape[1])(s)), 1e-12).T


def _speeds(timed: TimedReference, layout: Layout, index: int) -> Float[Array, " nodes"]:
    """Return the squared speeds of a motion at the nodes of a spline, limited where singular."""
    total = int(layout.nodes[-1])
    x = timed.squared_speeds * (total / len(timed.path.pieces)) ** 2
    low, high = layout.starts[index : index + 2].tolist()
    nodes = np.linspace(low, high, (high - low) * PER_PIECE + 1)
    speeds = np.interp(nodes, np.linspace(0.0, total, len(x)), x)
    limited: Float[Array, " nodes"] = np.minimum(speeds, 10.0 * np.median(speeds))
    return limited
