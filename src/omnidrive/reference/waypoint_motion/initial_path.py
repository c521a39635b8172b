"""Initial path of the optimisation: around keep-out regions, with interpolated headings."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.errors import OmnidriveError
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import SplinePath, search
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference.path_optimisation.spline_basis import spline_basis
from omnidrive.reference.waypoint_motion.constraints import Constraint
from omnidrive.reference.waypoint_motion.layout import Layout
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint

_CELLS = 160
"""Cells of the longer side of the grid on which a way around regions is searched."""

_CHECKS = 200
"""Points of a straight leg at which regions are evaluated."""


class InitialPath(NamedTuple):
    """Initial splines, and the headings at waypoints.

    Attributes:
        paths: One spline for each pair of neighbouring stops.
        yaws: Prescribed headings, in rad, unwrapped to be near those of the splines; NaN: free.
        layout: Pieces of the splines.
        held: For each spline, the first and the last of each run of control points with one
            heading, see :meth:`Layout.held`.
    """

    paths: tuple[SplinePath, ...]
    yaws: Float[Array, " waypoints"]
    layout: Layout
    held: tuple[list[tuple[int, int]], ...]


def initial_path(
    waypoints: Sequence[MotionWaypoint],
    sections: Sequence[MotionSection],
    constraints: Sequence[Constraint],
    body_radius: float,
    guess: Sequence[Float[Array, "poses 3"]] = (),
) -> InitialPath:
    """Return splines near straight legs, or near shortest ways around regions where these block.

    Args:
        waypoints: The waypoints.
        sections: Sections between them.
        constraints: Constraints on poses.
        body_radius: Radius of the robot, in m.
        guess: Poses from each waypoint to the next, which the splines follow; empty: unknown.
    """
    legs = [each[:, :2] for each in guess] or [
        _leg(waypoints, k, constraints, body_radius) for k in range(len(waypoints) - 1)
    ]
    lengths = np.array([cumulative_length(leg)[-1] for leg in legs])
    layout = Layout.of(waypoints, lengths)
    s, columns = _positions(legs, layout)
    nodes, yaws = _known_yaws(waypoints, constraints, layout, s, columns)
    if guess:
        nodes, yaws = s, np.unwrap(np.concatenate([each[:, 2] for each in guess]))
    given = np.array([np.nan if w.yaw is None else w.yaw for w in waypoints])
    at_nodes = np.interp(layout.nodes, nodes, yaws)
    given = given + 2.0 * np.pi * np.round((at_nodes - given) / (2.0 * np.pi))
    paths: list[SplinePath] = []
    held = tuple(layout.held(sections, spline) for spline in range(len(layout.pieces)))
    for spline, pieces in enumerate(layout.pieces.tolist()):
        start = int(layout.starts[spline])
        knots = np.concatenate([[0] * 3, np.arange(pieces + 1), [pieces] * 3])
        sites = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0 + start
        shape = np.stack([*(np.interp(sites, s, c) for c in columns.T),
                          np.interp(sites, nodes, yaws)], axis=1)  # fmt: skip
        _move_into_lanes(shape, waypoints, sections, layout, spline)
        paths.append(SplinePath(shape))
    found = InitialPath(tuple(paths), given, layout, held)
    return found._replace(paths=through(waypoints, found, found.paths))


def _move_into_lanes(
    control: Float[Array, "points 3"],
    waypoints: Sequence[MotionWaypoint],
    sections: Sequence[MotionSection],
    layout: Layout,
    spline: int,
) -> None:
    """Move the control points of pieces with a lane to within half of its width."""
    here = list(layout.waypoints(spline))
    for section in sections:
        low, high = max(section.first, here[0]), min(section.last, here[-1])
        start, end = (
            np.array([waypoints[k].x, waypoints[k].y]) for k in (section.first, section.last)
        )
        length = float(np.linalg.norm(end - start))
        if not isfinite(section.lane) or low >= high or length == 0.0:
            continue
        normal = np.array([start[1] - end[1], end[0] - start[0]]) / length
        inside = slice(layout.local(spline, low), layout.local(spline, high) + 3)
        off = (control[inside, :2] - start) @ normal
        excess = off - np.clip(off, -0.5 * section.lane, 0.5 * section.lane)
        control[inside, :2] -= excess[:, None] * normal


def through(
    waypoints: Sequence[MotionWaypoint], guess: InitialPath, paths: Sequence[SplinePath]
) -> tuple[SplinePath, ...]:
    """Return splines, moved a little to meet, to pass waypoints and to hold headings exactly."""
    found: list[SplinePath] = []
    for index, path in enumerate(paths):
        control = path.control_points.copy()
        if found:
            control[0] = found[-1].control_points[-1]
        found.append(SplinePath(_through(waypoints, guess, index, control)))
    return tuple(found)


def held_yaw(guess: InitialPath, spline: int, run: tuple[int, int]) -> float | None:
    """Return the prescribed heading of a run of control points, in rad; None: it is free."""
    low, high = run
    layout = guess.layout
    known = [
        float(guess.yaws[k])
        for k in layout.waypoints(spline)
        if low <= layout.local(spline, k) <= high - 2 and np.isfinite(guess.yaws[k])
    ]
    return known[0] if known else None


def _through(
    waypoints: Sequence[MotionWaypoint],
    guess: InitialPath,
    spline: int,
    control: Float[Array, "points 3"],
) -> Float[Array, "points 3"]:
    """Return the nearest control points whose spline passes its waypoints exactly."""
    layout, yaws = guess.layout, guess.yaws
    for run in guess.held[spline]:
        inside = slice(run[0], run[1] + 1)
        yaw = held_yaw(guess, spline, run)
        control[inside, 2] = control[inside, 2].mean() if yaw is None else yaw
    basis = spline_basis(len(control))
    for columns, wanted in (
        ([0, 1], [(k, (w.x, w.y)) for k, w in enumerate(waypoints) if w.fixed]),
        ([2], [(k, (yaw,)) for k, yaw in enumerate(yaws.tolist()) if np.isfinite(yaw)]),
    ):
        here = [(k, value) for k, value in wanted if k in layout.waypoints(spline)]
        if here:
            rows = basis([float(layout.local(spline, k)) for k, _ in here])
            missing = np.array([value for _, value in here]) - rows @ control[:, columns]
            control[:, columns] += rows.T @ np.linalg.solve(rows @ rows.T, missing)
    return control


def _leg(
    waypoints: Sequence[MotionWaypoint],
    index: int,
    constraints: Sequence[Constraint],
    body_radius: float,
) -> Float[Array, "points 2"]:
    """Return a polyline from one waypoint to the next."""
    ends = np.array([(w.x, w.y) for w in waypoints[index : index + 2]])
    here = [
        each
        for each in constraints
        if each.region is not None and each.section.first <= index and each.section.last > index
    ]
    straight = np.linspace(ends[0], ends[1], _CHECKS)
    if not here or not _blocked(here, straight, body_radius).any():
        return ends
    corners = np.vstack([ends, *(each.region.vertices for each in here if each.region)])
    pad = 4.0 * body_radius + max(
        (2.0 * each.region.rounding for each in here if each.region), default=0.0
    )
    low, high = corners.min(axis=0), corners.max(axis=0)
    pad += 0.3 * float((high - low).max())
    low, high = low - pad, high + pad
    cell = float((high - low).max()) / _CELLS
    columns, rows = np.ceil((high - low) / cell).astype(int).tolist()
    centres = np.stack(
        np.meshgrid(*(low[k] + cell * (np.arange(n) + 0.5) for k, n in enumerate((columns, rows)))),
        axis=-1,
    )
    grid = OccupancyGrid(_blocked(here, centres, body_radius + cell), cell, (low[0], low[1]))
    cells = [grid.nearest_free(*end) for end in ends.tolist()]
    if cells[0] is None or cells[1] is None:
        return ends
    try:
        found = search(grid, cells[0][0], cells[1][0], method="lazy-theta")
    except OmnidriveError:
        return ends
    return np.vstack([ends[:1], grid.centres(found.cells[1:-1]), ends[1:]])


def _blocked(
    constraints: Sequence[Constraint], points: Float[Array, "*n 2"], distance: float
) -> Bool[Array, "*n"]:
    """Return which points are nearer than a distance to the forbidden side of a region."""
    blocked = np.zeros(points.shape[:-1], bool)
    for each in constraints:
        if each.region is not None:
            depth = each.region.depth(points)
            blocked |= depth < distance if each.kind == "keep-in" else depth > -distance
    return blocked


def _positions(
    legs: Sequence[Float[Array, "points 2"]], layout: Layout
) -> tuple[Float[Array, " n"], Float[Array, "n 2"]]:
    """Return path parameters and positions of the corners of all legs."""
    s, points = [], []
    for leg, (low, high) in zip(
        legs, zip(layout.nodes[:-1], layout.nodes[1:], strict=True), strict=True
    ):
        distance = cumulative_length(leg)
        share = distance / distance[-1] if distance[-1] > 0.0 else np.linspace(0.0, 1.0, len(leg))
        s.append(low + (high - low) * share)
        points.append(leg)
    return np.concatenate(s), np.concatenate(points)


def _known_yaws(
    waypoints: Sequence[MotionWaypoint],
    constraints: Sequence[Constraint],
    layout: Layout,
    s: Float[Array, " n"],
    positions: Float[Array, "n 2"],
) -> tuple[Float[Array, " known"], Float[Array, " known"]]:
    """Return path parameters and headings, unwrapped, where waypoints or points give them."""
    known = {float(layout.nodes[k]): w.yaw for k, w in enumerate(waypoints) if w.yaw is not None}
    for each in constraints:
        section = each.section
        if each.kind != "point" or section.point_at is None:
            continue
        low, high = layout.nodes[[section.first, section.last]].tolist()
        for at in np.linspace(low, high, 2 * (high - low) + 1).tolist():
            x, y = (np.interp(at, s, column) for column in positions.T)
            direction = np.arctan2(section.point_at[1] - y, section.point_at[0] - x)
            known.setdefault(at, float(direction) + section.point_offset)
    if not known:
        return np.zeros(1), np.zeros(1)
    at = np.array(sorted(known))
    return at, np.unwrap([known[value] for value in at.tolist()])
