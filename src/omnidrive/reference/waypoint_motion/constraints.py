"""Constraints on poses: their names, their margins, and the proof that they hold."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import wrap
from omnidrive.planning import SplinePath
from omnidrive.reference.path_optimisation.spline_basis import bezier_basis, spline_basis
from omnidrive.reference.waypoint_motion.layout import Layout, Part
from omnidrive.reference.waypoint_motion.regions import Region, separation
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint

_DEPTH = 10
"""Number of times that a piece is halved at most for a proof."""

_SAMPLES = 64
"""Points of a piece at which its heading is compared with a direction."""


class Constraint(NamedTuple):
    """Constraint on the poses of a section.

    Attributes:
        kind: Kind of the constraint.
        section: The section.
        name: Name in messages.
        region: Region to keep in or out of; None for other kinds.
        line: Unit normal and offset of the line of a lane, in m; None for other kinds.
    """

    kind: Literal["keep-in", "keep-out", "point", "lane"]
    section: MotionSection
    name: str
    region: Region | None = None
    line: tuple[Float[Array, " 2"], float] | None = None

    @property
    def unit(self) -> str:
        """Unit of the margin."""
        return "rad" if self.kind == "point" else "m"


def constraints_of(
    waypoints: Sequence[MotionWaypoint], sections: Sequence[MotionSection]
) -> list[Constraint]:
    """Return all constraints on poses."""
    found = []
    for number, each in enumerate(sections):
        suffix = f"of section {number}"
        found += [
            Constraint("keep-in", each, f"keep-in {region} {suffix}", region)
            for region in each.keep_in
        ]
        found += [
            Constraint("keep-out", each, f"keep-out {region} {suffix}", region)
            for region in each.keep_out
        ]
        if each.point_at is not None:
            x, y = each.point_at
            found.append(Constraint("point", each, f"pointing at ({x:g}, {y:g}) {suffix}"))
        if isfinite(each.lane):
            start, end = waypoints[each.first], waypoints[each.last]
            along = np.array([end.x - start.x, end.y - start.y])
            along = along / max(float(np.linalg.norm(along)), 1e-12)
            normal = np.array([-along[1], along[0]])
            line = (normal, float(normal @ [start.x, start.y]))
            found.append(Constraint("lane", each, f"lane {suffix}", None, line))
    return found


def margins(
    constraints: Sequence[Constraint],
    layout: Layout,
    paths: Sequence[SplinePath],
    body_radius: float,
) -> list[float]:
    """Return lower bounds of the margins of constraints, in m; negative if violated.

    A region or a lane is kept with at least that margin by all points of the path: the Bezier
    points of its pieces, halved where necessary, are inside (their hull is, because depth is
    concave), or separated from the region by a line. The margin of a heading, in rad, is the least
    of 64 points on each piece.
    """
    return [
        min(
            (_margin(each, part, paths[part.spline], body_radius)
             for part in layout.parts(each.section.first, each.section.last)),
            default=inf,
        )
        for each in constraints
    ]  # fmt: skip


def _margin(constraint: Constraint, part: Part, path: SplinePath, body_radius: float) -> float:
    control = path.control_points
    if constraint.kind == "point":
        s = np.linspace(part.first, part.last, _SAMPLES * (part.last - part.first) + 1)
        poses = spline_basis(len(control))(s) @ control
        off = np.abs(pointing_error(constraint.section, poses))
        return float(constraint.section.point_tolerance - off.max())
    bezier = bezier_basis(len(control)) @ control[:, :2]
    if part.first == part.last:
        pieces = np.repeat(bezier[None, [3 * part.first]], 4, axis=1)
    else:
        pieces = np.stack([bezier[3 * k : 3 * k + 4] for k in range(part.first, part.last)])
    return _least(constraint, pieces, body_radius)


def pointing_error(section: MotionSection, poses: Float[Array, "n 3"]) -> Float[Array, " n"]:
    """Return the deviations of headings from the direction to point in, in rad."""
    assert section.point_at is not None
    away = section.point_at - poses[:, :2]
    return wrap(poses[:, 2] - section.point_offset - np.arctan2(away[:, 1], away[:, 0]))


def _least(constraint: Constraint, pieces: Float[Array, "pieces 4 2"], body_radius: float) -> float:
    """Return a lower bound of the margin on pieces, which are halved where it is not positive."""
    least = inf
    for depth in range(_DEPTH + 1):
        bounds = _bounds(constraint, pieces, body_radius)
        open_ = bounds < 0.0
        if depth == _DEPTH or not open_.any():
            return min(least, float(bounds.min()))
        least = min(least, float(bounds[~open_].min(initial=inf)))
        pieces = _halves(pieces[open_])
    return least


def _bounds(
    constraint: Constraint, pieces: Float[Array, "pieces 4 2"], body_radius: float
) -> Float[Array, " pieces"]:
    if constraint.line is not None:
        normal, offset = constraint.line
        off: Float[Array, " pieces"] = np.abs(pieces @ normal - offset).max(axis=1)
        return constraint.section.lane - off
    assert constraint.region is not None
    if constraint.kind == "keep-in":
        inside: Float[Array, " pieces"] = constraint.region.depth(pieces).min(axis=1)
        return inside - body_radius
    return separation(constraint.region, pieces)[0] - body_radius


def _halves(pieces: Float[Array, "n 4 2"]) -> Float[Array, "m 4 2"]:
    """Return the Bezier points of both halves of pieces (de Casteljau)."""
    a, b, c, d = (pieces[:, k] for k in range(4))
    ab, bc, cd = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + d)
    abc, bcd = 0.5 * (ab + bc), 0.5 * (bc + cd)
    middle = 0.5 * (abc + bcd)
    first = np.stack([a, ab, abc, middle], axis=1)
    return np.concatenate([first, np.stack([middle, bcd, cd, d], axis=1)])
