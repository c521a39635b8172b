"""A path on its map."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from omnidrive.evaluation.figures.style import FAINT, INK, canvas, legend_above, styled
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path, SplinePath

Array = np.ndarray

_ARROWS = 24  # headings drawn along the path
_OUTSIDE = "#f4f5f7"


def route_figure(
    grid: OccupancyGrid, keepout: OccupancyGrid, path: Path, spline: SplinePath
) -> Figure:
    """What a planner found: map, cells, smooth path and headings.

    Args:
        grid: The obstacles.
        keepout: Where the robot's centre must not be.
        path: Cells found by the search.
        spline: The smoothed path.
    """
    with styled():
        left, right, bottom, top = grid.extent
        figure = canvas(6.4, 1.0 + 5.4 * min(max((top - bottom) / (right - left), 0.3), 1.5))
        axes = figure.add_subplot()
        draw_map(axes, grid, keepout, path)
        x, y, _ = spline.poses(np.linspace(0.0, 1.0, 2001)).T
        axes.plot(x, y, color=INK, lw=1.2, label="Smooth path")
        x, y, yaw = spline.poses(np.linspace(0.0, 1.0, _ARROWS)).T
        axes.quiver(x, y, np.cos(yaw), np.sin(yaw), color="#0072b2", width=0.0035, scale=32,
                    zorder=4, label="Heading")  # fmt: skip
        legend_above(figure, axes)
    return figure


def draw_map(axes: Axes, grid: OccupancyGrid, keepout: OccupancyGrid, path: Path) -> None:
    """Obstacles, the zone to keep out of and the cells that the search found."""
    near = keepout.occupied_on(grid)
    height, width = (count * grid.resolution for count in near.shape)
    placed = Affine2D().rotate(grid.yaw).translate(*grid.origin)
    axes.set_facecolor(_OUTSIDE)  # seen around a turned map
    axes.imshow(
        _shades(grid, near),
        extent=(0.0, width, 0.0, height),
        transform=placed + axes.transData,
        origin="lower",
        interpolation="nearest",
        zorder=0,
    )
    left, right, bottom, top = grid.extent
    x, y = path.poses[:, 0], path.poses[:, 1]
    axes.plot(x, y, ".", color=FAINT, ms=2.5, label="Cells found", zorder=1)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.set(xlabel="x in m", ylabel="y in m")
    axes.grid(visible=False)


def _shades(grid: OccupancyGrid, near: Array) -> Array:
    """Grey obstacles within their lighter inflation, on white."""
    shades = np.full((*near.shape, 3), 255, dtype=np.uint8)
    shades[near] = (228, 231, 235)
    shades[grid.occupied] = (96, 104, 114)
    return shades
