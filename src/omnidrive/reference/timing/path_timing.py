"""Fastest motion within limits along a given path, from rest to rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np

from omnidrive.choices import Heading
from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import WorldTwist, wrap
from omnidrive.maps import CostMap
from omnidrive.parameter import check_choice
from omnidrive.planning import SplinePath
from omnidrive.reference.headings.free_heading import free_heading
from omnidrive.reference.headings.heading_policies import facing, fast_candidates, turning_once
from omnidrive.reference.headings.heading_sections import HeadingSection, heading_in_sections
from omnidrive.reference.headings.initial_headings import check_end_headings
from omnidrive.reference.headings.least_strafing import least_strafing
from omnidrive.reference.reference import Reference
from omnidrive.reference.timing.jerk_timing import fastest_reference
from omnidrive.reference.timing.limits import LimitRows, MotionLimits, jerk_rows, limit_rows
from omnidrive.reference.timing.piecewise_path import FixedHeading, PiecewisePath
from omnidrive.reference.timing.smooth_reference import SmoothReference
from omnidrive.reference.timing.time_parameterization import estimated_duration
from omnidrive.reference.timing.timed_reference import TimedReference
from omnidrive.reference.timing.zone_speeds import ZoneSpeeds
from omnidrive.robot import Chassis

_TOLERANCE = 1e-6
"""Largest difference of headings that count as equal, in rad."""
_BEST = 3
"""Candidates of heading `fastest` that are timed precisely, in addition to the tangent."""
_TWIST_TOLERANCE = 0.01
"""Largest difference of twists at the ends, in m/s and rad/s, beside 2 % of the twist."""


def time_within_limits(
    path: SplinePath,
    chassis: Chassis,
    limits: MotionLimits,
    *,
    heading: Heading | Sequence[HeadingSection] = "path",
    yaw: float | None = None,
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
    duration: float | None = None,
    start_twist: WorldTwist | None = None,
    goal_twist: WorldTwist | None = None,
    zones: CostMap | None = None,
    target: tuple[float, float] | None = None,
) -> TimedReference | SmoothReference:
    """Return the fastest motion along ``path`` within ``limits``, by default from rest to rest.

    With limits of the jerk its acceleration is continuous, and zero at rest.

    Args:
        path: Path to follow; it may consist of a turn on the spot.
        chassis: Wheel kinematics and wheel speed limit.
        limits: All other limits.
        heading: Kind of heading, see :data:`omnidrive.choices.Heading`, or sections of the path.
        yaw: Heading for ``fixed``, in rad; None: that of the start, the goal or the path's start.
        start_yaw: Heading at the start, in rad, modulo whole turns; None: free.
        goal_yaw: Heading at the goal, likewise.
        duration: Duration to which the motion is slowed, in s; None: the shortest.
        start_twist: Twist in W at the start along the path; m/s, m/s, rad/s. None: rest.
        goal_twist: That at the goal.
        zones: Map whose ``max_speed`` limits the speed of the origin of B.
        target: Point (x, y) in W, m, for ``face``.

    Raises:
        InvalidInput: A limit or heading is not possible, or the yaw jerk of ``tangent`` is limited.
        InvalidReference: The path does not move, has no direction of travel for heading
            ``tangent``, contradicts an end heading, or cannot be followed in ``duration`` or with
            the twists at its ends.
        MissingExtra: ``free`` without CasADi.
    """
    if isinstance(heading, str) or not isinstance(heading, Sequence):
        check_choice("heading", heading, get_args(Heading))
    rows, jerks = limit_rows(chassis, limits), jerk_rows(limits)
    check_end_headings(start_yaw, goal_yaw)
    zone_speeds = None if zones is None or zones.max_speed is None else zones.max_speeds
    candidates = _with_heading(path, rows, heading, yaw, (start_yaw, goal_yaw), target)
    for each in candidates:
        _check_ends(each, heading, (start_yaw, goal_yaw))
    if len(candidates) > _BEST:
        candidates = _fastest(candidates, rows, zone_speeds)
    twists = start_twist, goal_twist
    timed = [
        fastest_reference(each, rows, jerks, _end_speeds(each, twists), zone_speeds)
        for each in candidates
    ]
    reference = min(timed, key=lambda each: each.duration)
    if duration is not None:
        reference = reference.with_duration(duration)
    _check_twists(reference, twists)
    return reference


def _with_heading(  # noqa: PLR0917
    path: SplinePath,
    rows: tuple[LimitRows, ...],
    heading: Heading | Sequence[HeadingSection],
    yaw: float | None,
    ends: tuple[float | None, float | None],
    target: tuple[float, float] | None,
) -> list[PiecewisePath]:
    """Return the path with a kind of heading; for ``fastest`` all that are compared."""
    kind: FixedHeading = "path"
    if heading == "fastest":
        return fast_candidates(path, *ends)
    if not isinstance(heading, str):
        path = heading_in_sections(path, heading, *ends)
    elif heading == "free":
        path = free_heading(path, rows, *ends)
    elif heading == "face":
        if target is None:
            raise InvalidInput("heading 'face' needs a target (x, y) in m")
        path = facing(path, target, *ends)
    elif heading == "strafe-least":
        path = least_strafing(path, *ends)
    elif heading in {"goal-first", "goal-last"}:
        path = turning_once(path, *ends, early=heading == "goal-first")
    elif heading in {"tangent", "fixed"}:
        kind = "tangent" if heading == "tangent" else "fixed"
        if heading == "fixed" and yaw is None:
            yaw = ends[1] if ends[0] is None else ends[0]
    return [PiecewisePath.of(path, kind, yaw)]


def _fastest(
    paths: list[PiecewisePath], rows: tuple[LimitRows, ...], zone_speeds: ZoneSpeeds | None
) -> list[PiecewisePath]:
    """Return the paths with the shortest estimated durations, and the tangent."""
    ranked = sorted(paths, key=lambda each: estimated_duration(each, rows, zone_speeds))
    return [*ranked[:_BEST], *(each for each in ranked[_BEST:] if each.tangent)]


def _end_speeds(
    path: PiecewisePath, twists: tuple[WorldTwist | None, WorldTwist | None]
) -> tuple[float, float]:
    """Return ds/dt at the ends of a path for which the twists there are nearest to ``twists``."""
    at = path.at(np.array([0, len(path.pieces) - 1]), np.array([0.0, 1.0]))
    speeds = [0.0, 0.0]
    for end, (along, twist) in enumerate(zip(at.first_derivatives, twists, strict=True)):
        square = float(along @ along)
        if twist is not None and square > 0.0:
            speeds[end] = max(float(along @ np.array(twist)) / square, 0.0)
    return speeds[0], speeds[1]


def _check_twists(
    reference: Reference, twists: tuple[WorldTwist | None, WorldTwist | None]
) -> None:
    """Raise InvalidReference if the motion has other twists in W at its ends than required."""
    for end, t, required in zip(("start", "goal"), (0.0, reference.duration), twists, strict=True):
        if required is None:
            continue
        found = reference.at(t).twist
        off = np.abs(np.subtract(found, required))
        if (off > _TWIST_TOLERANCE + 0.02 * np.abs(required).max()).any():
            texts = [f"({x:.3g} m/s, {y:.3g} m/s, {w:.3g} rad/s)" for x, y, w in (required, found)]
            raise InvalidReference(
                f"the path cannot be followed with the twist {texts[0]} at the {end}: within the "
                f"limits it has {texts[1]} there"
            )


def _check_ends(
    path: PiecewisePath,
    heading: Heading | Sequence[HeadingSection],
    required: tuple[float | None, float | None],
) -> None:
    """Raise an error if the path has other headings at its ends than required."""
    ends = np.array([0, len(path.pieces) - 1])
    headings = path.at(ends, np.array([0.0, 1.0])).poses[:, 2].tolist()
    for name, own, yaw in zip(("start", "goal"), headings, required, strict=True):
        if yaw is not None and abs(wrap(own - yaw)) > _TOLERANCE:
            raise InvalidReference(
                f"with heading '{heading}' the robot's heading at the {name} is {wrap(own):.3f} "
                f"rad, not {yaw:.3f} rad as required; choose heading 'free', or 'path' on a path "
                f"with that heading, or leave the heading at the {name} free"
            )
