"""Minimum-time motion through waypoints within limits and constraints of sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import NoPathFound, NoPathYet
from omnidrive.planning import SplinePath
from omnidrive.planning.deadline import Deadline
from omnidrive.reference.path_optimisation.transcription import casadi
from omnidrive.reference.timing.limits import MotionLimits, SectionLimit, limit_rows
from omnidrive.reference.timing.piecewise_path import PiecewisePath
from omnidrive.reference.timing.time_parameterization import PathSections, time_optimal_reference
from omnidrive.reference.timing.timed_reference import TimedReference
from omnidrive.reference.waypoint_motion.constraints import constraints_of, margins
from omnidrive.reference.waypoint_motion.faults import TOLERANCE, check_guess, check_problem
from omnidrive.reference.waypoint_motion.initial_path import InitialPath, initial_path, through
from omnidrive.reference.waypoint_motion.layout import Layout
from omnidrive.reference.waypoint_motion.program import Problem, Program
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint
from omnidrive.robot import Chassis


@dataclass(frozen=True, eq=False, slots=True)
class WaypointMotion:
    """Fastest motion found through waypoints.

    Regions and lanes are proved for the whole curve; pointing is checked at 64 samples per piece.

    Attributes:
        reference: The motion; its :attr:`~TimedReference.limit_usage` has the limits of sections
            as well.
        waypoint_times: Time at which it passes each waypoint, in s.
        status: Origin of the motion. ``converged``: a local optimum of the discretised problem;
            ``capped``: the solver stopped before convergence; ``guess``: the initial path, because
            the solver found no faster one that satisfies all constraints.
        message: One sentence on the result.
        margins: Lower bound of the margin of each constraint on poses, by its name; m, and rad for
            headings. At least -1e-5.
    """

    reference: TimedReference
    waypoint_times: Float[Array, " waypoints"]
    status: Literal["converged", "capped", "guess"]
    message: str
    margins: dict[str, float]


def minimum_time_through(
    waypoints: Sequence[MotionWaypoint],
    chassis: Chassis,
    limits: MotionLimits,
    sections: Sequence[MotionSection] = (),
    *,
    body_radius: float = 0.0,
    guess: Sequence[Float[Array, "poses 3"]] = (),
    time_limit: float | None = None,
) -> WaypointMotion:
    """Return the fastest motion through ``waypoints`` that the solver finds.

    The motion rests at both ends and at stops. Path, headings and speeds are optimised together,
    see :class:`~omnidrive.reference.waypoint_motion.program.Program`; then the timing along the
    path is computed exactly. Waypoints are met exactly, limits hold between samples as well, and
    regions are kept by the whole curve, which is proved after the optimisation, to 1e-5 m.

    Args:
        waypoints: 2 to 200 waypoints.
        chassis: Wheel kinematics and wheel speed limit.
        limits: All other limits of the whole motion.
        sections: Constraints between waypoints; in messages they are numbered from 0.
        body_radius: Radius of the disc around the origin of B that stays in and out of regions, in
            m; 0: only the origin.
        guess: Poses of a known motion from each waypoint to the next, from which the optimisation
            starts, one array for each leg; x and y in m, yaw in rad. Empty: straight legs and ways
            around regions.
        time_limit: Time for the optimisation, in s, positive; None: no limit.

    Raises:
        InvalidInput: The problem has faults, such as a waypoint inside a keep-out region; the
            message names all of them.
        NoPathFound: No motion was found; the message names the constraint that hinders it most.
            With a time limit that was reached: NoPathYet.
        MissingExtra: CasADi is not installed.
    """
    casadi("a motion through waypoints needs", "")
    deadline = None if time_limit is None else Deadline.of(time_limit)
    points = tuple(waypoints)
    counted = check_problem(points, sections, body_radius)
    check_guess(guess, len(points) - 1)
    rows = limit_rows(chassis, limits)
    constraints = tuple(constraints_of(points, counted))
    section_limits = tuple((each, each.limit_rows(k)) for k, each in enumerate(counted))
    problem = Problem(points, constraints, rows, section_limits, body_radius)
    start = initial_path(points, counted, constraints, body_radius, guess)
    layout = start.layout
    found, status, reference = _fastest(problem, start, deadline)
    nodes = layout.nodes * (len(reference.squared_speeds) - 1) // layout.nodes[-1]
    bounds = margins(constraints, layout, found, body_radius)
    return WaypointMotion(
        reference,
        reference.times[nodes],
        status,
        f"{reference.duration:.3f} s through {len(points)} waypoints",
        {each.name: bound for each, bound in zip(constraints, bounds, strict=True)},
    )


def _fastest(
    problem: Problem, start: InitialPath, deadline: Deadline | None
) -> tuple[tuple[SplinePath, ...], Literal["converged", "capped", "guess"], TimedReference]:
    """Return the faster of the solution and the initial path that satisfies all constraints.

    Raises:
        NoPathFound: Neither satisfies all constraints.
    """
    timed = _timed(problem, start.layout, start.paths)
    program = Program(problem, start, timed, deadline)
    solution = program.solve()
    found = through(problem.waypoints, start, solution.paths)
    if _holds(problem, start.layout, found):
        reference = _timed(problem, start.layout, found)
        if reference.duration <= timed.duration or not _holds(problem, start.layout, start.paths):
            return found, "converged" if solution.converged else "capped", reference
    elif not _holds(problem, start.layout, start.paths):
        if deadline is not None and deadline.remaining <= 0.0:
            raise NoPathYet(
                f"no motion was found within the time limit of {deadline.limit:g} s; there may be "
                "one: allow more time"
            )
        raise NoPathFound(_blame(problem, program))
    return start.paths, "guess", timed


def _timed(problem: Problem, layout: Layout, paths: Sequence[SplinePath]) -> TimedReference:
    """Return the fastest motion along splines within all limits."""
    path = PiecewisePath.concatenated(paths)
    scale = len(path.pieces) // int(layout.nodes[-1])
    nodes = (layout.nodes * scale).tolist()
    limits = tuple(
        SectionLimit(limit, float(nodes[section.first]), float(nodes[section.last]))
        for section, limits in problem.section_limits
        for limit in limits
    )
    stops = tuple((layout.starts[1:-1] * scale).tolist())
    return time_optimal_reference(path, problem.limits, sections=PathSections(limits, stops))


def _holds(problem: Problem, layout: Layout, paths: Sequence[SplinePath]) -> bool:
    bounds = margins(problem.constraints, layout, paths, problem.body_radius)
    return all(bound >= -TOLERANCE for bound in bounds)


def _blame(problem: Problem, program: Program) -> str:
    """Return a message that names the constraint with the largest violation."""
    elastic = program.solve(elastic=True)
    named = [
        f"{each.name}, which the nearest motion found violates by {violation:.3g} {each.unit}"
        for violation, each in sorted(
            zip(elastic.violations.tolist(), problem.constraints, strict=True),
            key=lambda pair: -pair[0],
        )
        if violation > TOLERANCE
    ]
    if not named:
        return (
            "no motion through the waypoints was found that satisfies all constraints of the "
            "sections; give another waypoint with fixed=False that guides the initial path"
        )
    return f"no motion through the waypoints was found, because of the {named[0]}"
