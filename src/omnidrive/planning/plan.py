"""From a map, a start and a goal to a smooth path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.errors import InvalidPlace, NoPathFound
from omnidrive.maps import OccupancyGrid
from omnidrive.parameter import Bounds
from omnidrive.planning.headings import with_headings
from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.polyline import resampled, travelled
from omnidrive.planning.search import search

Array = np.ndarray


class Place(NamedTuple):
    """Where to start or end: x, y in m, yaw in rad; without yaw, along the path."""

    x: float
    y: float
    yaw: Annotated[float, Bounds(-6.3, 6.3, "rad")] | None = None


@dataclass(frozen=True, slots=True)
class PathOptions:
    """How a path is searched and smoothed; the defaults suit maps with fine cells.

    Attributes:
        greedy: Search best-first instead of for the shortest way (the paper's published code).
        cut_corners: Let diagonal moves pass occupied cells.
        spacing: Distance between control points, in m. It is halved until the smooth path stays
            in free cells; 0 takes every cell as it is and does not check (the paper).
        turn_within: Distance over which the heading turns from the start's to the path's and
            from the path's to the goal's, in m; 0 turns between two control points.
    """

    greedy: bool = False
    cut_corners: bool = False
    spacing: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.25
    turn_within: Annotated[float, Bounds(0.0, 10.0, "m")] = 1.0


def plan(
    grid: OccupancyGrid, start: Place, goal: Place, *, inflation: float, options: PathOptions
) -> tuple[Path, SplinePath]:
    """Search a way over cells whose centres keep ``inflation`` (m) from obstacles, and smooth it.

    The smooth path stays in those cells, so that it is nowhere nearer to an obstacle than
    ``inflation`` less half a cell's diagonal.

    Returns:
        The cells found, as poses, and the spline along them.

    Raises:
        InvalidPlace: The robot cannot stand at start or goal.
        NoPathFound: There is no way between them, or none that can be smoothed.
    """
    start, goal = Place(*start), Place(*goal)
    free = grid.inflated(inflation)
    for name, place in (("start", start), ("goal", goal)):
        _check_place(grid, free, name, place, inflation)
    cells = search(
        free,
        free.cell(start.x, start.y),
        free.cell(goal.x, goal.y),
        method="greedy" if options.greedy else "astar",
        cut_corners=options.cut_corners,
    ).cells
    points = np.array([free.centre(row, col) for row, col in cells.tolist()])
    points = np.vstack([points, points[-1:]]) if len(points) == 1 else points
    points[0], points[-1] = start[:2], goal[:2]
    path = Path(with_headings(points, start.yaw, goal.yaw, options.turn_within))
    return path, _smooth(free, points, start, goal, options)


def _smooth(
    free: OccupancyGrid, points: Float[Array, "points 2"], start: Place, goal: Place,
    options: PathOptions,
) -> SplinePath:  # fmt: skip
    """Spline through ever closer control points until it stays in free cells."""
    spacing = options.spacing
    while True:
        every_cell = spacing <= free.resolution
        chosen = points if every_cell and len(points) >= 4 else _resample(points, spacing)
        spline = SplinePath(with_headings(chosen, start.yaw, goal.yaw, options.turn_within))
        if options.spacing == 0.0 or _is_free(free, spline):
            return spline
        if every_cell:
            raise NoPathFound(
                "a smooth path along the way found cannot be kept off the obstacles; "
                "use a map with finer cells"
            )
        spacing *= 0.5


def _is_free(free: OccupancyGrid, spline: SplinePath) -> bool:
    """Whether every point of the spline, sampled at a tenth of a cell, lies in a free cell."""
    samples = 2 + int(10.0 * spline.length / free.resolution)
    x, y, _ = spline.poses(np.linspace(0.0, 1.0, samples)).T
    return not any(map(free.is_occupied, x.tolist(), y.tolist()))


def _resample(points: Float[Array, "points 2"], spacing: float) -> Float[Array, "samples 2"]:
    """Points at equal distances of about ``spacing`` (m) along a polyline; at least four."""
    length = travelled(points)[-1]
    return resampled(points, max(4, len(points) if spacing == 0.0 else 1 + round(length / spacing)))


def _check_place(
    grid: OccupancyGrid, free: OccupancyGrid, name: str, place: Place, inflation: float
) -> None:
    """Refuse a place outside the map, in an obstacle or nearer to one than ``inflation``."""
    where = f"the {name} ({place.x:g}, {place.y:g}) m"
    if not np.isfinite(place[:2]).all() or not (place.yaw is None or np.isfinite(place.yaw)):
        raise InvalidPlace(f"{where} must be finite numbers: x and y in m, heading in rad")
    if not grid.contains(*grid.cell(place.x, place.y)):
        left, right, bottom, top = grid.extent
        raise InvalidPlace(
            f"{where} lies outside the map, which spans x {left:g} to {right:g} m "
            f"and y {bottom:g} to {top:g} m"
        )
    if not free.is_occupied(place.x, place.y):
        return
    if free.occupied.all():
        raise InvalidPlace(
            f"nowhere on the map can the robot's centre keep {inflation:g} m from every obstacle; "
            "choose a smaller robot or margin"
        )
    rows, cols = np.nonzero(~free.occupied)
    x, y = free.centre(0, 0)
    centres = np.stack([x + cols * free.resolution, y + rows * free.resolution], axis=1)
    near = centres[np.argmin(np.hypot(*(centres - place[:2]).T))]
    if grid.is_occupied(place.x, place.y):
        fact = "lies inside an obstacle, its inflation or a cell that is not known to be free"
    else:
        gap = float(grid.clearance(np.array([place[:2]]))[0])
        fact = (
            f"is {gap:.2f} m from an obstacle; the robot's centre must keep {inflation:g} m, and "
            f"half a diagonal of the map's cells of {grid.resolution:g} m"
        )
    raise InvalidPlace(
        f"{where} {fact}; the nearest place to stand is ({near[0]:g}, {near[1]:g}) m"
    )
