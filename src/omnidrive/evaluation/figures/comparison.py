"""Figures that compare runs: paths, headings and errors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from scipy.spatial import cKDTree

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.plan import Box, draw_map
from omnidrive.evaluation.figures.style import (
    COLUMN,
    DARK,
    DASHED,
    PAGE,
    curve_style,
    legend_above,
    new_figure,
    set_log_scale,
)
from omnidrive.evaluation.measures.metrics import START_PHASE, heading_error, position_error
from omnidrive.evaluation.palette import ControllerStyle, controller_styles, horizon_styles
from omnidrive.evaluation.study_logs import RecordedRun, StudyLogs
from omnidrive.evaluation.tables.table import number_text

_MIN_HALF_SIDE = 0.04  # m; of the magnified square
_WHOLE_MAP_RATIO = 0.6  # size of path to map from which the whole map is shown
_MAX_RATIO = 0.12  # half side of the magnified square to extent of the path, at most
_TICK_FORMAT = "{x:g}"  # 0.1, 1, 10 instead of powers of ten
_SHARES = np.linspace(0.0, 1.0, 1001)  # parameters of the points of a path
_MIN_ERROR = 1e-2  # mm, mrad; smaller distances are drawn at this value


class Curve(NamedTuple):
    """One run in a figure, with its label and style."""

    label: str
    """Text of the legend."""
    style: ControllerStyle
    result: RecordedRun

    def properties(self, k: int, lines: list[Curve]) -> dict[str, Any]:
        """Return the line properties as curve ``k`` of ``lines``."""
        return curve_style(self.style, k, len(lines), len(self.result.log.t))


def xy_comparison(logs: StudyLogs, task: str) -> Figure | None:
    """Draw the paths on the map, magnified at the largest error, and the errors over time."""
    lines = _curves(logs, task)
    if not lines:
        return None
    figure = new_figure(PAGE, 4.1)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.0), height_ratios=(1.15, 1.0))
    whole, close, error = (figure.add_subplot(grid[cell]) for cell in _CELLS)
    draw_map(whole, logs.obstacles, logs.free_space, logs.grid_path, _view(logs))
    for axes in (whole, close):
        _paths(axes, lines)
    if task == "noise":
        _measured(close, lines, logs.repeats)
    x, y, half = _largest_deviation(lines)
    wide = 2.2 * half
    close.set(xlim=(x - wide, x + wide), ylim=(y - half, y + half), aspect="equal")
    close.set(xlabel="x in m", ylabel="y in m")
    close.set_title("Section with the largest error")
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


def heading_comparison(logs: StudyLogs, task: str) -> Figure | None:
    """Draw the headings and the wrapped heading errors over time."""
    lines = _curves(logs, task)
    if not lines:
        return None
    figure = new_figure(COLUMN, 4.1)
    heading, error = figure.subplots(2, 1, sharex=True, height_ratios=(1.25, 1.0))
    for k, line in enumerate(lines):
        run, properties = line.result.log, line.properties(k, lines)
        heading.plot(run.t, run.pose[:, 2], label=line.label, **properties)
        error.plot(run.t, heading_error(run.pose, run.target) * 1e3, **properties)
    run = _longest(lines).result.log
    heading.plot(run.t, run.target[:, 2], color=DARK, ls=DASHED, lw=1.0, label="Reference")
    heading.set(ylabel="heading in rad", xlim=(0.0, max(run.t[-1], 1e-3)))
    error.set(ylabel="heading error in mrad", xlabel="time in s")
    _scale_error(error)
    legend_above(figure, heading)
    return figure


def _scale_error(axes: Axes) -> None:
    """Make the y axis of heading errors linear up to 1 mrad, and logarithmic beyond."""
    largest = max(float(np.abs(line.get_ydata()).max()) for line in axes.lines)
    if largest > 1.0:
        axes.set_yscale("symlog", linthresh=1.0, linscale=0.6)
        axes.set_title("Heading error (linear up to 1 mrad)")
    else:
        axes.set_title("Heading error")
        if largest < _MIN_ERROR:
            axes.set_ylim(-_MIN_ERROR, _MIN_ERROR)
    axes.yaxis.set_major_formatter(StrMethodFormatter(_TICK_FORMAT))


def horizon_bars(logs: StudyLogs) -> Figure | None:
    """Draw ME and MAE of each prediction horizon as bars."""
    lines = _curves(logs, "horizon")
    if not lines:
        return None
    figure = new_figure(COLUMN, 2.2)
    distance, turn = figure.subplots(1, 2)
    metrics = [line.result.record.metrics for line in lines]
    _bars(distance, lines, [m["me"] * 1e3 for m in metrics], "ME in mm")
    _bars(turn, lines, [m["mae"] * 1e3 for m in metrics], "MAE in mrad")
    distance.set_title("Position")
    turn.set_title("Heading")
    return figure


def _curves(logs: StudyLogs, task: str) -> list[Curve]:
    """Return the runs of ``task`` with its longest duration; horizons from short to long.

    Runs that ended at their first sample are omitted.
    """
    runs = tuple(r for r in logs.select(task) if len(r.log.t) > 1)
    longest = max((r.duration for r in runs), default=0.0)
    runs = tuple(r for r in runs if r.duration == longest)
    if task != "horizon":
        styles = controller_styles(logs)
        return [Curve(r.controller, styles[r.controller], r) for r in runs]
    runs = tuple(sorted(runs, key=lambda r: r.horizon))
    one_controller = len({r.controller for r in runs}) == 1
    return [
        Curve(
            f"N = {r.horizon}" if one_controller else f"{r.controller}, N = {r.horizon}",
            style,
            r,
        )
        for r, style in zip(runs, horizon_styles(len(runs)), strict=True)
    ]


def _bars(axes: Axes, lines: list[Curve], heights: list[float], label: str) -> None:
    positions = range(len(lines))
    bars = axes.bar(
        positions, heights, width=0.68, color=[line.style.colour.light for line in lines]
    )
    axes.bar_label(bars, list(map(number_text, heights)), padding=2, fontsize=6)
    names = [line.label.removeprefix("N = ") for line in lines]
    axes.set_xticks(positions, names, rotation=0 if max(map(len, names)) < 4 else 45)
    axes.set(xlabel="horizon N in steps", ylabel=label)
    axes.margins(y=0.12)
    axes.grid(visible=False, axis="x")


def _longest(lines: list[Curve]) -> Curve:
    """Return the curve with the most rows; its target is the whole reference."""
    return max(lines, key=lambda line: len(line.result.log.t))


def _view(logs: StudyLogs) -> Box:
    """Return the visible box: the whole map, or the surroundings of a path that is small on it."""
    path = logs.grid_path.poses if logs.grid_path else logs.spline.poses(_SHARES)
    low, high = (f(path[:, :2], axis=0) for f in (np.min, np.max))
    left, right, bottom, top = logs.obstacles.extent
    if np.max((high - low) / (right - left, top - bottom)) >= _WHOLE_MAP_RATIO:
        return left, right, bottom, top
    x, y = (0.5 * (low + high)).tolist()
    half = 0.5 * float((high - low).max()) + 3.0 * logs.robot.body_radius
    return x - half, x + half, y - half, y + half


def _paths(axes: Axes, lines: list[Curve]) -> None:
    for k, line in enumerate(lines):
        x, y = line.result.log.pose[:, 0], line.result.log.pose[:, 1]
        axes.plot(x, y, label=line.label, **line.properties(k, lines))
    x, y = _longest(lines).result.log.target[:, :2].T
    axes.plot(x, y, color=DARK, ls=DASHED, lw=1.0, label="Reference", zorder=40)


def _measured(axes: Axes, lines: list[Curve], seeds: int) -> None:
    for _, style, result in lines:
        x, y = result.log.measured[:, 0], result.log.measured[:, 1]
        axes.plot(x, y, ".", color=style.colour.light, ms=3.5, alpha=0.45, mew=0.0, zorder=1)
    text = "dots: measured" + (f"; first of {seeds} seeds" if seeds > 1 else "")
    axes.text(0.985, 0.04, text, transform=axes.transAxes, ha="right", fontsize=7.5)


def _distances(axes: Axes, lines: list[Curve]) -> None:
    """Draw the distance to the reference over time, on a logarithmic axis."""
    low_quantiles = []
    for k, line in enumerate(lines):
        result = line.result
        distance = np.maximum(position_error(result.log.pose, result.log.target) * 1e3, _MIN_ERROR)
        low_quantiles.append(float(np.quantile(distance, 0.03)))
        axes.plot(result.log.t, distance, **line.properties(k, lines))
    set_log_scale(axes, "y")
    axes.set_ylim(bottom=0.7 * min(low_quantiles))  # the first samples are 0
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 200.0 * low else (1.0,)))
    axes.yaxis.set_major_formatter(StrMethodFormatter(_TICK_FORMAT))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set(xlabel="time in s", ylabel="position error in mm")
    axes.set(xlim=(0.0, max(_longest(lines).result.log.t[-1], 1e-3)))
    axes.set_title("Distance to the reference")


def _largest_deviation(lines: list[Curve]) -> tuple[float, float, float]:
    """Return centre and half side (m) of a square around the largest deviation from the path."""
    target = _longest(lines).result.log.target[:, :2]
    path = cKDTree(_dense(target))
    best = (-1.0, 0.0, 0.0)
    for _, _, result in lines:
        late = result.log.t >= min(START_PHASE, 0.5 * result.log.t[-1])
        points = result.log.pose[late, :2]
        deviation, _ = path.query(points)
        k = int(np.argmax(deviation))
        best = max(best, (float(deviation[k]), *points[k].tolist()))
    largest, x, y = best
    return (
        x,
        y,
        max(min(6.0 * largest, _MAX_RATIO * float(np.ptp(target, axis=0).max())), _MIN_HALF_SIDE),
    )


def _dense(points: Float[Array, "rows 2"]) -> Float[Array, "dense 2"]:
    """Interpolate linearly, with 20 points per segment, for the search of the nearest point."""
    rows = np.arange(len(points))
    fine = np.linspace(0.0, len(points) - 1.0, 20 * len(points))
    return np.column_stack([np.interp(fine, rows, points[:, i]) for i in (0, 1)])
