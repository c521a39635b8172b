"""A path on its map, and how fast it is travelled."""

from __future__ import annotations

from math import ceil

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import (
    DARK,
    DPI,
    MUTED,
    figure_style,
    legend_above,
    new_figure,
)
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path

_ARROWS = 24  # headings drawn along the path, at equal times
_BLUE = "#0072b2"
_OUTSIDE = "#f4f5f7"
_TAKEN = np.uint8(2)
_SHADES = np.array([(255, 255, 255), (228, 231, 235), (96, 104, 114)], np.uint8)
"""Of what is free, too near to an obstacle, taken."""

Box = tuple[float, float, float, float]


def plan_figure(
    grid: OccupancyGrid,
    free: OccupancyGrid,
    way: Path,
    times: Float[Array, " times"],
    motion: Float[Array, "times 6"],
) -> Figure:
    """What a planner found: map, way, path and headings, and below them the speeds over time.

    Args:
        grid: The obstacles.
        free: Where the robot's centre may be.
        way: Cells found by the search.
        times: In s.
        motion: Setpoints at these times, columns as in :class:`~omnidrive.reference.Reference`.
    """
    with figure_style():
        left, right, bottom, top = grid.extent
        tall = 5.4 * min(max((top - bottom) / (right - left), 0.3), 1.5)
        figure = new_figure(6.4, 2.6 + tall)
        above, below = figure.subplots(2, 1, height_ratios=[tall, 1.5])
        draw_map(above, grid, free, way)
        above.plot(motion[:, 0], motion[:, 1], color=DARK, lw=1.2, label="Smooth path")
        x, y, yaw = motion[np.linspace(0, len(times) - 1, _ARROWS).astype(int), :3].T
        above.quiver(x, y, np.cos(yaw), np.sin(yaw), color=_BLUE, width=0.0035, scale=32,
                     zorder=4, label="Heading")  # fmt: skip
        _draw_speeds(below, times, motion)
        legend_above(figure, above)
    return figure


def _draw_speeds(
    axes: Axes, times: Float[Array, " times"], motion: Float[Array, "times 6"]
) -> None:
    """Speed and yaw rate over time, each with its axis."""
    axes.plot(times, np.hypot(motion[:, 3], motion[:, 4]), color=DARK)
    axes.set(xlabel="time in s", xlim=(times[0], times[-1]))
    axes.set_ylabel("speed in m/s")
    axes.set_ylim(bottom=0.0)
    turning = axes.twinx()
    turning.plot(times, motion[:, 5], color=_BLUE, lw=0.9)
    turning.set_ylabel("yaw rate in rad/s", color=_BLUE)
    turning.grid(visible=False)
    turning.spines["right"].set_visible(True)


def draw_map(
    axes: Axes, grid: OccupancyGrid, free: OccupancyGrid, way: Path, view: Box | None = None
) -> None:
    """Obstacles, where the robot's centre may be, and the cells that the search found.

    Where a pixel shows several cells it has the darkest shade among them, so that thin walls stay.

    Args:
        axes: Where to draw.
        grid: The obstacles.
        free: Where the robot's centre may be.
        way: Cells found by the search.
        view: (left, right, bottom, top) of what is shown, in m; by default all of the map.
    """
    view = grid.extent if view is None else view
    rows, cols = _seen(grid, view)
    kinds = np.where(grid.occupied, _TAKEN, free.occupied_on(grid).view(np.uint8))[rows, cols]
    k = _cells_per_pixel(axes, grid, view)
    kinds = _darkest(kinds, k)
    first = np.array([cols.start, rows.start]) * grid.resolution
    last = first + np.array(kinds.shape[::-1]) * k * grid.resolution
    axes.set_facecolor(_OUTSIDE)  # seen around a turned map
    axes.imshow(
        _SHADES[kinds],
        extent=(first[0], last[0], first[1], last[1]),
        transform=Affine2D().rotate(grid.yaw).translate(*grid.origin) + axes.transData,
        origin="lower",
        interpolation="nearest",
        zorder=0,
    )
    x, y = way.poses[:, 0], way.poses[:, 1]
    axes.plot(x, y, ".", color=MUTED, ms=2.5, label="Cells found", zorder=1)
    axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
    axes.set(xlabel="x in m", ylabel="y in m")
    axes.grid(visible=False)


def _seen(grid: OccupancyGrid, view: Box) -> tuple[slice, slice]:
    """Rows and columns of the grid that the view may show; at least one of each."""
    left, right, bottom, top = view
    corners = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    cells = grid.cells_of(corners).clip(0, np.array(grid.occupied.shape) - 1)
    rows, cols = ((int(c.min()), int(c.max()) + 1) for c in cells.T)
    return slice(*rows), slice(*cols)


def _cells_per_pixel(axes: Axes, grid: OccupancyGrid, view: Box) -> int:
    """How many of the grid's cells are next to each other on a pixel of the picture, at most.

    Panels become a little larger when the figure arranges them.
    """
    left, right, bottom, top = view
    inches = np.array(axes.get_window_extent().size) / axes.figure.dpi
    metres_per_inch = float((np.array([right - left, top - bottom]) / inches).max())
    return max(1, ceil(metres_per_inch / DPI / grid.resolution))


def _darkest(kinds: UInt8[Array, "rows cols"], k: int) -> UInt8[Array, "fewer_rows fewer_cols"]:
    """The greatest number in every square of ``k`` cells' side; the last ones may be cut."""
    if k == 1:
        return kinds
    rows, cols = (np.arange(0, count, k) for count in kinds.shape)
    pooled: UInt8[Array, "fewer_rows fewer_cols"] = np.maximum.reduceat(
        np.maximum.reduceat(kinds, rows, axis=0), cols, axis=1
    )
    return pooled
