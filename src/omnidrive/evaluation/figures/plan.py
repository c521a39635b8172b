"""Map, path and speed profile of a plan."""

from __future__ import annotations

from math import ceil

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import (
    BLUE,
    DARK,
    DPI,
    MUTED,
    PAGE,
    RED,
    figure_style,
    legend_above,
    new_figure,
)
from omnidrive.evaluation.map_cells import cell_kinds, max_pool
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.planning import Path, SplinePath

_ARROWS = 24  # headings along the path, at equal time intervals
_SAMPLES = 1001  # points of a path without times
_OUTSIDE = "#f4f5f7"
_SHADES = np.array([(255, 255, 255), (228, 231, 235), (96, 104, 114)], np.uint8)
"""Colours of free, inflated and occupied cells."""

Box = tuple[float, float, float, float]


def plan_figure(
    grid: OccupancyGrid,
    free_space: OccupancyGrid,
    grid_path: Path | None,
    times: Float[Array, " times"],
    motion: Float[Array, "times 6"],
    *,
    costs: CostMap | None = None,
    outline: Float[Array, "corners 2"] | None = None,
) -> Figure:
    """Draw map, grid path, smooth path and headings, and below them the speeds over time.

    Args:
        grid: Occupancy grid of the obstacles.
        free_space: Inflated grid: its free cells may contain the robot's centre.
        grid_path: Cells of the searched path.
        times: Times, s.
        motion: Setpoints at these times; columns as in :class:`~omnidrive.reference.Reference`.
        costs: Costs and speed zones, drawn under the path.
        outline: Corners (x, y) of the robot's body in B, m, drawn along the path.
    """
    with figure_style():
        figure, above, below = _panels(grid)
        draw_map(above, grid, free_space, grid_path)
        if costs is not None:
            _draw_costs(above, costs)
        if outline is not None:
            _draw_outlines(above, motion[:, :3], outline)
        _draw_path(above, motion[:, :3])
        _draw_speeds(below, times, motion)
        if costs is not None and costs.max_speed is not None:
            limits = costs.max_speeds(motion[:, :2])
            limits[np.isinf(limits)] = np.nan
            below.plot(times, limits, color=RED, lw=1.0, ls="--", label="Limit of the zone")
        legend_above(figure, above)
    return figure


def path_figure(
    grid: OccupancyGrid, free_space: OccupancyGrid, grid_path: Path, spline: SplinePath
) -> Figure:
    """Draw map, grid path, smooth path and headings, and below them curvature and clearance.

    Args:
        grid: Occupancy grid of the obstacles.
        free_space: Inflated grid: its free cells may contain the robot's centre.
        grid_path: Cells of the searched path.
        spline: The smooth path.
    """
    u = np.linspace(0.0, 1.0, _SAMPLES)
    poses = spline.poses(u)
    steps = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)
    distance = np.concatenate([[0.0], np.cumsum(steps)])
    with figure_style():
        figure, above, below = _panels(grid)
        draw_map(above, grid, free_space, grid_path)
        _draw_path(above, poses)
        below.plot(distance, grid.clearance(poses[:, :2]), color=DARK)
        below.set(xlabel="distance along the path in m", xlim=(0.0, max(distance[-1], 1e-3)))
        below.set_ylabel("distance to obstacles in m")
        below.set_ylim(bottom=0.0)
        curvature = np.where(np.isfinite(values := spline.curvature(u)), values, np.nan)
        _second_axis(below, "curvature in 1/m").plot(distance, curvature, color=BLUE, lw=0.9)
        legend_above(figure, above)
    return figure


def _panels(grid: OccupancyGrid) -> tuple[Figure, Axes, Axes]:
    """Return a figure with a panel for the map and a low one below it."""
    left, right, bottom, top = grid.extent
    tall = 5.4 * min(max((top - bottom) / (right - left), 0.3), 1.5)
    figure = new_figure(PAGE, 2.6 + tall)
    above, below = figure.subplots(2, 1, height_ratios=[tall, 1.5])
    return figure, above, below


def _draw_path(axes: Axes, poses: Float[Array, "points 3"]) -> None:
    """Draw positions as a line, and some headings as arrows."""
    axes.plot(poses[:, 0], poses[:, 1], color=DARK, lw=1.2, label="Smooth path")
    x, y, yaw = poses[np.linspace(0, len(poses) - 1, _ARROWS).astype(int)].T
    axes.quiver(x, y, np.cos(yaw), np.sin(yaw), color=BLUE, width=0.0035, scale=32,
                zorder=4, label="Heading")  # fmt: skip


def _draw_outlines(
    axes: Axes, poses: Float[Array, "points 3"], outline: Float[Array, "corners 2"]
) -> None:
    """Draw the robot's body at equal time intervals."""
    for x, y, yaw in poses[np.linspace(0, len(poses) - 1, _ARROWS).astype(int)]:
        turn = np.array([(np.cos(yaw), np.sin(yaw)), (-np.sin(yaw), np.cos(yaw))])
        corners = outline @ turn + (x, y)
        axes.fill(*corners.T, fill=False, ec=MUTED, lw=0.5, zorder=3)


def _draw_costs(axes: Axes, costs: CostMap) -> None:
    """Draw the costs of free cells in yellow to red, and the speed zones hatched in blue."""
    grid = costs.grid
    k = _cells_per_pixel(axes, grid, grid.extent)
    rows, cols = grid.occupied.shape
    top = float(costs.costs[~grid.occupied].max(initial=0.0))
    size = np.array([cols, rows]) * grid.resolution
    place = Affine2D().rotate(grid.yaw).translate(*grid.origin) + axes.transData
    box = (0.0, size[0], 0.0, size[1])
    if top > 0.0:
        shown = np.where(grid.occupied, np.nan, costs.costs)[::k, ::k]
        alpha = 0.4 * np.nan_to_num(shown, nan=0.0) / top
        axes.imshow(shown, cmap="YlOrRd", vmin=0.0, vmax=top, alpha=np.clip(alpha, 0.0, 1.0),
                    extent=box, transform=place, origin="lower", interpolation="nearest",
                    zorder=0.5)  # fmt: skip
    if costs.max_speed is not None and np.isfinite(costs.max_speed).any():
        zone = np.isfinite(costs.max_speed[::k, ::k]).astype(float)
        across = (np.arange(zone.shape[1]) + 0.5) * size[0] / zone.shape[1]
        along = (np.arange(zone.shape[0]) + 0.5) * size[1] / zone.shape[0]
        points = grid.points_of(
            np.stack(np.meshgrid(along, across, indexing="ij"), -1).reshape(-1, 2) / grid.resolution
        )
        x, y = points.T.reshape(2, *zone.shape)
        with matplotlib.rc_context({"hatch.color": BLUE, "hatch.linewidth": 0.3}):
            axes.contourf(x, y, zone, levels=[0.5, 1.5], colors="none", hatches=["//"], zorder=0.6)
        axes.contour(x, y, zone, levels=[0.5], colors=BLUE, linewidths=0.8, zorder=0.6)


def _second_axis(axes: Axes, label: str) -> Axes:
    """Return a second ordinate on the right, in blue."""
    second: Axes = axes.twinx()
    second.set_ylabel(label, color=BLUE)
    second.grid(visible=False)
    second.spines["right"].set_visible(True)
    return second


def _draw_speeds(
    axes: Axes, times: Float[Array, " times"], motion: Float[Array, "times 6"]
) -> None:
    """Draw speed and yaw rate over time, each with its own axis."""
    axes.plot(times, np.hypot(motion[:, 3], motion[:, 4]), color=DARK)
    axes.set(xlabel="time in s", xlim=(times[0], times[-1]))
    axes.set_ylabel("speed in m/s")
    axes.set_ylim(bottom=0.0)
    _second_axis(axes, "yaw rate in rad/s").plot(times, motion[:, 5], color=BLUE, lw=0.9)


def draw_map(
    axes: Axes,
    grid: OccupancyGrid,
    free_space: OccupancyGrid,
    grid_path: Path | None,
    view: Box | None = None,
) -> None:
    """Draw obstacles, inflated cells and the grid path.

    A pixel that covers several cells gets the darkest of their colours, so that thin walls remain
    visible.

    Args:
        axes: Target axes.
        grid: Occupancy grid of the obstacles.
        free_space: Inflated grid: its free cells may contain the robot's centre.
        grid_path: Cells of the searched path.
        view: Visible box (left, right, bottom, top), m; by default the whole map.
    """
    view = grid.extent if view is None else view
    rows, cols = _visible_cells(grid, view)
    kinds = cell_kinds(grid, free_space)[rows, cols]
    k = _cells_per_pixel(axes, grid, view)
    kinds = max_pool(kinds, k)
    first = np.array([cols.start, rows.start]) * grid.resolution
    last = first + np.array(kinds.shape[::-1]) * k * grid.resolution
    axes.set_facecolor(_OUTSIDE)  # visible around a rotated map
    axes.imshow(
        _SHADES[kinds],
        extent=(first[0], last[0], first[1], last[1]),
        transform=Affine2D().rotate(grid.yaw).translate(*grid.origin) + axes.transData,
        origin="lower",
        interpolation="nearest",
        zorder=0,
    )
    if grid_path is not None:
        x, y = grid_path.poses[:, 0], grid_path.poses[:, 1]
        axes.plot(x, y, ".", color=MUTED, ms=2.5, label="Grid path", zorder=1)
    axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
    axes.set(xlabel="x in m", ylabel="y in m")
    axes.grid(visible=False)


def _visible_cells(grid: OccupancyGrid, view: Box) -> tuple[slice, slice]:
    """Return the rows and columns of the grid inside the view; at least one of each."""
    left, right, bottom, top = view
    corners = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    cells = grid.cells_of(corners).clip(0, np.array(grid.occupied.shape) - 1)
    rows, cols = ((int(c.min()), int(c.max()) + 1) for c in cells.T)
    return slice(*rows), slice(*cols)


def _cells_per_pixel(axes: Axes, grid: OccupancyGrid, view: Box) -> int:
    """Return the number of cells per side that one pixel covers, at least 1.

    The layout engine may enlarge the panel slightly afterwards.
    """
    left, right, bottom, top = view
    inches = np.array(axes.get_window_extent().size) / axes.figure.dpi
    metres_per_inch = float((np.array([right - left, top - bottom]) / inches).max())
    return max(1, ceil(metres_per_inch / DPI / grid.resolution))
