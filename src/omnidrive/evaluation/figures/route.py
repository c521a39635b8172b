"""A path on its map, and how fast it is travelled."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from omnidrive.evaluation.figures.style import FAINT, INK, canvas, legend_above, styled
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path

Array = np.ndarray

_ARROWS = 24  # headings drawn along the path, at equal times
_BLUE = "#0072b2"
_OUTSIDE = "#f4f5f7"


def plan_figure(
    grid: OccupancyGrid,
    keepout: OccupancyGrid,
    way: Path,
    times: Float[Array, " times"],
    motion: Float[Array, "times 6"],
) -> Figure:
    """What a planner found: map, way, path and headings, and below them the speeds over time.

    Args:
        grid: The obstacles.
        keepout: Where the robot's centre must not be.
        way: Cells found by the search.
        times: In s.
        motion: Setpoints at these times, columns as in :class:`~omnidrive.reference.Reference`.
    """
    with styled():
        left, right, bottom, top = grid.extent
        tall = 5.4 * min(max((top - bottom) / (right - left), 0.3), 1.5)
        figure = canvas(6.4, 2.6 + tall)
        above, below = figure.subplots(2, 1, height_ratios=[tall, 1.5])
        draw_map(above, grid, keepout, way)
        above.plot(motion[:, 0], motion[:, 1], color=INK, lw=1.2, label="Smooth path")
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
    axes.plot(times, np.hypot(motion[:, 3], motion[:, 4]), color=INK)
    axes.set(xlabel="time in s", xlim=(times[0], times[-1]))
    axes.set_ylabel("speed in m/s")
    axes.set_ylim(bottom=0.0)
    turning = axes.twinx()
    turning.plot(times, motion[:, 5], color=_BLUE, lw=0.9)
    turning.set_ylabel("yaw rate in rad/s", color=_BLUE)
    turning.grid(visible=False)
    turning.spines["right"].set_visible(True)


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
