"""Runs side by side: where they went, and how far from the reference."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from scipy.spatial import cKDTree

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.curves import Curve, curves
from omnidrive.evaluation.figures.plan import Box, draw_map
from omnidrive.evaluation.figures.style import DARK, legend_above, new_figure
from omnidrive.evaluation.metrics import START_PHASE, heading_error, position_error
from omnidrive.evaluation.results import StudyResults

_DASHES = (0, (4, 2.5))
_WINDOW = 0.04  # m; least half side of the magnified square
_MOST_OF_THE_MAP = 0.6
_SHARE = 0.12  # of the path's extent that it shows at most
_PLAIN = "{x:g}"  # 0.1, 1, 10 rather than powers of ten
_LEAST = 1e-2  # mm; smaller errors are not worth a decade of the axis


def xy_comparison(results: StudyResults, task: str) -> Figure | None:
    """Paths on the map, magnified where they differ most, and their error over time."""
    lines = curves(results, task)
    if not lines:
        return None
    figure = new_figure(8.6, 4.6)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.0), height_ratios=(1.15, 1.0))
    whole, close, error = (figure.add_subplot(grid[cell]) for cell in _CELLS)
    draw_map(whole, results.obstacles, results.free_space, results.grid_path, _view(results))
    for axes in (whole, close):
        _paths(axes, lines)
    if task == "noise":
        _measured(close, lines, results.repeats)
    x, y, half = _interesting(lines)
    wide = 2.2 * half
    close.set(xlim=(x - wide, x + wide), ylim=(y - half, y + half), aspect="equal")
    close.set(xlabel="x in m", ylabel="y in m")
    close.set_title("Where they differ most")
    close.locator_params(nbins=5)
    whole.add_patch(
        Rectangle((x - wide, y - half), 2 * wide, 2 * half, fill=False, lw=1.0, ec=DARK)
    )
    whole.annotate("magnified", (x + wide, y), (6, 0), textcoords="offset points", va="center",
                   bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})  # fmt: skip
    _distances(error, lines)
    legend_above(figure, whole)
    return figure


_CELLS = ((slice(None), 0), (0, 1), (1, 1))


def heading_comparison(results: StudyResults, task: str) -> Figure | None:
    """Headings over time, and their wrapped error."""
    lines = curves(results, task)
    if not lines:
        return None
    figure = new_figure(7.2, 4.6)
    heading, error = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1.0))
    for k, (label, colour, result) in enumerate(lines):
        run = result.run
        heading.plot(run.t, run.pose[:, 2], color=colour, label=label, lw=_width(k, lines))
        error.plot(run.t, heading_error(run.pose, run.target) * 1e3, color=colour)
    run = _fullest(lines).result.run
    heading.plot(run.t, run.target[:, 2], color=DARK, ls=_DASHES, lw=1.0, label="Reference")
    heading.set(ylabel="heading in rad", xlim=(0.0, max(run.t[-1], 1e-3)))
    error.set_yscale("symlog", linthresh=1.0, linscale=0.6)
    error.yaxis.set_major_formatter(StrMethodFormatter(_PLAIN))
    error.set(ylabel="heading error in mrad", xlabel="time in s")
    error.set_title("Heading minus reference; linear within 1 mrad, logarithmic beyond")
    legend_above(figure, heading)
    return figure


def _width(k: int, lines: list[Curve]) -> float:
    """Curves get thinner in the order in which they hide each other."""
    return 2.8 - 1.5 * k / max(len(lines) - 1, 1)


def _fullest(lines: list[Curve]) -> Curve:
    """The curve with most rows: its target is the whole reference."""
    return max(lines, key=lambda line: len(line.result.run.t))


def _view(results: StudyResults) -> Box:
    """The whole map, or the path's surroundings where it takes up little of the map."""
    low, high = (f(results.grid_path.poses[:, :2], axis=0) for f in (np.min, np.max))
    left, right, bottom, top = results.obstacles.extent
    if np.max((high - low) / (right - left, top - bottom)) >= _MOST_OF_THE_MAP:
        return left, right, bottom, top
    x, y = (0.5 * (low + high)).tolist()
    half = 0.5 * float((high - low).max()) + 3.0 * results.robot.body_radius
    return x - half, x + half, y - half, y + half


def _paths(axes: Axes, lines: list[Curve]) -> None:
    for k, (label, colour, result) in enumerate(lines):
        x, y = result.run.pose[:, 0], result.run.pose[:, 1]
        axes.plot(x, y, color=colour, label=label, lw=_width(k, lines), zorder=2 + k)
    x, y = _fullest(lines).result.run.target[:, :2].T
    axes.plot(x, y, color=DARK, ls=_DASHES, lw=1.0, label="Reference", zorder=40)


def _measured(axes: Axes, lines: list[Curve], seeds: int) -> None:
    for _, colour, result in lines:
        x, y = result.run.measured[:, 0], result.run.measured[:, 1]
        axes.plot(x, y, ".", color=colour, ms=3.5, alpha=0.45, mew=0.0, zorder=1)
    text = "dots: as measured" + (f"; first of {seeds} seeds" if seeds > 1 else "")
    axes.text(0.985, 0.04, text, transform=axes.transAxes, ha="right", fontsize=7.5)


def _distances(axes: Axes, lines: list[Curve]) -> None:
    """Distance to the reference over time, on a logarithmic axis."""
    usual = []
    for _, colour, result in lines:
        distance = np.maximum(position_error(result.run.pose, result.run.target) * 1e3, _LEAST)
        usual.append(float(np.quantile(distance, 0.03)))
        axes.plot(result.run.t, distance, color=colour)
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.7 * min(usual))  # the first samples start at zero
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 200.0 * low else (1.0,)))
    axes.yaxis.set_major_formatter(StrMethodFormatter(_PLAIN))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set(xlabel="time in s", ylabel="position error in mm")
    axes.set(xlim=(0.0, max(_fullest(lines).result.run.t[-1], 1e-3)))
    axes.set_title("Distance to the reference")


def _interesting(lines: list[Curve]) -> tuple[float, float, float]:
    """Centre and half side (m) of the square in which a run strays farthest from the path."""
    target = _fullest(lines).result.run.target[:, :2]
    way = cKDTree(_dense(target))
    best = (-1.0, 0.0, 0.0)
    for _, _, result in lines:
        late = result.run.t >= min(START_PHASE, 0.5 * result.run.t[-1])
        points = result.run.pose[late, :2]
        stray, _ = way.query(points)
        k = int(np.argmax(stray))
        best = max(best, (float(stray[k]), *points[k].tolist()))
    stray_most, x, y = best
    return x, y, max(min(6.0 * stray_most, _SHARE * float(np.ptp(target, axis=0).max())), _WINDOW)


def _dense(points: Float[Array, "rows 2"]) -> Float[Array, "dense 2"]:
    """Twenty points along each straight piece, so that the nearest one is near enough."""
    rows = np.arange(len(points))
    fine = np.linspace(0.0, len(points) - 1.0, 20 * len(points))
    return np.column_stack([np.interp(fine, rows, points[:, i]) for i in (0, 1)])
