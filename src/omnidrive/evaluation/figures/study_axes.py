"""Effects of the axes of a study: curves, heat maps over two axes, and variance shares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import DARK, PAGE, legend_above, new_figure, set_log_scale
from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.evaluation.statistics.evidence import LevelEvidence, StudyEvidence
from omnidrive.evaluation.statistics.variance_shares import variance_shares
from omnidrive.evaluation.tables.table import level_text, number_text
from omnidrive.evaluation.verdict import TaskVerdict

_MAX_COLUMNS = 3  # tasks in one figure of curves
_MAX_MAPS = 8  # controllers in one figure of heat maps
_MAX_CELLS = 64  # of a heat map with numbers
_LOG_RATIO = 30.0
_WIDTH = 0.5  # of the points of all controllers at one category


def axis_curves(
    study: StudyEvidence,
    verdicts: Sequence[TaskVerdict],
    styles: Mapping[str, ControllerStyle],
    path: str,
) -> Figure | None:
    """Draw mean with interval, and success rate if a run failed, along one axis."""
    shown = []
    for verdict in verdicts:
        levels = study.along(verdict.evidence.measure.name, path).get(verdict.evidence.task, [])
        if len(levels) > 1:
            shown.append((verdict, levels))
    shown = shown[:_MAX_COLUMNS]
    if not shown:
        return None
    lost = any(s.finished < s.runs for _, levels in shown for e in levels
               for s in e.evidence.summaries)  # fmt: skip
    figure = new_figure(PAGE, 3.7 if lost else 2.5)
    panels = figure.subplots(1 + lost, len(shown), squeeze=False, sharex="col",
                             height_ratios=(2.2, 1.0) if lost else (1.0,))  # fmt: skip
    for column, (verdict, levels) in enumerate(shown):
        _curves(panels[0, column], levels, styles)
        panels[0, column].set_title(verdict.evidence.task.label)
        panels[0, column].set_ylabel(verdict.evidence.measure.axis_label)
        if lost:
            _success(panels[1, column], levels, styles, labelled=column == 0)
        panels[-1, column].set_xlabel(path)
    legend_above(figure, panels[0, 0])
    return figure


def _positions(levels: Sequence[LevelEvidence], axes: Axes) -> list[float]:
    """Return the positions of the values on the x axis: numbers, or 0, 1, 2... for texts."""
    values = [each.level for each in levels]
    if _is_ordered(levels):
        if min(values) > 0.0 and max(values) > _LOG_RATIO * min(values):
            set_log_scale(axes, "x")
        return values
    axes.set_xticks(range(len(values)), list(map(level_text, values)), rotation=30, ha="right")
    return [float(k) for k in range(len(values))]


def _curves(
    axes: Axes, levels: Sequence[LevelEvidence], styles: Mapping[str, ControllerStyle]
) -> None:
    x = _positions(levels, axes)
    factor = levels[0].evidence.measure.factor
    every: list[float] = []
    names = _controllers(levels)
    for k, name in enumerate(names):
        mean, low, high = factor * _means(levels, name)
        style = styles[name]
        colour, dash = style.colour.light, (0, style.dash) if style.dash else "-"
        if _is_ordered(levels):
            axes.plot(x, mean, label=name, color=colour, marker=style.marker, ms=3.2, ls=dash)
            axes.fill_between(x, low, high, color=colour, alpha=0.18, lw=0.0)
        else:  # nothing lies between two categories
            at = np.array(x) + _WIDTH * ((k + 0.5) / len(names) - 0.5)
            axes.plot(at, mean, label=name, color=colour, marker=style.marker, ms=4.0, ls="")
            axes.vlines(at, low, high, color=colour, lw=1.4)
        every += mean[np.isfinite(mean)].tolist()
    if every and min(every) > 0.0 and max(every) > _LOG_RATIO * min(every):
        set_log_scale(axes, "y")


def _controllers(levels: Sequence[LevelEvidence]) -> list[str]:
    """Return the controllers that have runs at some value."""
    return list(dict.fromkeys(s.controller for each in levels for s in each.evidence.summaries))


def _is_ordered(levels: Sequence[LevelEvidence]) -> bool:
    """Return whether the values of an axis are numbers."""
    return all(isinstance(each.level, float) for each in levels)


def _means(levels: Sequence[LevelEvidence], name: str) -> Float[Array, "3 levels"]:
    """Return mean and bounds of one controller at every value; NaN where it has no runs."""
    rows = []
    for each in levels:
        means = (s.mean[:3] for s in each.evidence.summaries if s.controller == name)
        rows.append(next(means, (np.nan, np.nan, np.nan)))
    found = np.array(rows, dtype=float)
    bounds: Float[Array, "3 levels"] = np.where(np.isfinite(found), found, np.nan).T
    return bounds


def _success(
    axes: Axes,
    levels: Sequence[LevelEvidence],
    styles: Mapping[str, ControllerStyle],
    *,
    labelled: bool,
) -> None:
    x = _positions(levels, axes)
    for name in _controllers(levels):
        rates = [
            next((s.success_rate for s in e.evidence.summaries if s.controller == name), np.nan)
            for e in levels
        ]
        style = styles[name]
        line = "-" if _is_ordered(levels) else ""
        axes.plot(x, 100.0 * np.array(rates), color=style.colour.light, marker=style.marker, ms=3.0,
                  ls=line)  # fmt: skip
    axes.set_ylim(-4.0, 104.0)
    if labelled:
        axes.set_ylabel("finished in %")


def heat_maps(study: StudyEvidence, verdicts: Sequence[TaskVerdict]) -> Figure | None:
    """Draw the mean over the two axes with the largest variance shares, a map per controller."""
    for verdict in verdicts:
        evidence, runs = verdict.evidence, study.runs
        shares = variance_shares(runs, evidence.measure.name, evidence.task)
        paths = [each.factor for each in shares if each.factor in runs.axes][:2]
        if len(paths) == 2:
            return _heat_maps(study, verdict, paths[0], paths[1])
    return None


def _heat_maps(study: StudyEvidence, verdict: TaskVerdict, across: str, up: str) -> Figure:
    evidence, runs = verdict.evidence, study.runs
    values = runs.values(evidence.measure.name) * evidence.measure.factor
    rows = (runs.task == runs.tasks.index(evidence.task)) & np.isfinite(values)
    (x_levels, x), (y_levels, y) = (_used_levels(runs, path, rows) for path in (across, up))
    names = [each.controller for each in evidence.ranking][:_MAX_MAPS]
    maps = []
    for name in names:
        own = rows & (runs.controller == runs.controllers.index(name))
        cell = y[own] * len(x_levels) + x[own]
        size = len(x_levels) * len(y_levels)
        counts = np.bincount(cell, minlength=size)
        with np.errstate(invalid="ignore"):
            means = np.bincount(cell, values[own], minlength=size) / counts
        maps.append(means.reshape(len(y_levels), len(x_levels)))
    columns = min(len(names), 4)
    lines = -(-len(names) // columns)
    figure = new_figure(PAGE, 0.7 + lines * 1.9)
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    norm, image = _norm(np.stack(maps)), None
    for axes, name, means in zip(panels.flat, names, maps, strict=False):
        image = axes.imshow(means, origin="lower", aspect="auto", cmap="viridis", norm=norm)
        _label_cells(axes, means, norm)
        axes.set_title(name)
        _ticks(axes, x_levels, y_levels)
    for axes in panels.flat[len(names) :]:
        axes.axis("off")
    figure.supxlabel(across, fontsize=8.0)
    figure.supylabel(up, fontsize=8.0)
    if image is not None:
        label = f"{evidence.measure.axis_label}, {evidence.task.label}"
        bar = figure.colorbar(image, ax=panels, label=label, pad=0.02, aspect=30)
        for part in (bar.ax.yaxis.set_major_formatter, bar.ax.yaxis.set_minor_formatter):
            part(StrMethodFormatter("{x:g}"))
    return figure


def _used_levels(runs: Any, path: str, rows: Any) -> tuple[list[Any], Any]:
    """Return the values of a factor that occur in some rows, and the index of every row."""
    levels, codes = runs.levels(path)
    used = np.unique(codes[rows])
    return [levels[k] for k in used], np.searchsorted(used, codes)


def _norm(values: Float[Array, "maps y x"]) -> Normalize:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return LogNorm(low, high) if low > 0.0 and high > 3.0 * low else Normalize(low, high)


def _label_cells(axes: Axes, means: Float[Array, "y x"], norm: Normalize) -> None:
    """Write the value into every cell, if there are few."""
    axes.grid(visible=False)
    if means.size > _MAX_CELLS:
        return
    for (row, column), value in np.ndenumerate(means):
        text = number_text(value) if isfinite(value) else "no run"
        dark = isfinite(value) and float(norm(value)) > 0.6
        axes.text(column, row, text, ha="center", va="center", fontsize=6.0,
                  color=DARK if dark or not isfinite(value) else "white")  # fmt: skip


def _ticks(axes: Axes, x_levels: Sequence[Any], y_levels: Sequence[Any]) -> None:
    for levels, set_ticks in ((x_levels, axes.set_xticks), (y_levels, axes.set_yticks)):
        step = -(-len(levels) // 8)
        ticks = range(0, len(levels), step)
        set_ticks(list(ticks), [level_text(levels[k])[:14] for k in ticks])
    if max(len(level_text(level)) for level in x_levels) > 5:
        axes.tick_params(axis="x", rotation=30)


def share_bars(study: StudyEvidence, verdicts: Sequence[TaskVerdict]) -> Figure | None:
    """Draw the variance shares of all factors with their intervals, a panel per task."""
    found = [
        (each, variance_shares(study.runs, each.evidence.measure.name, each.evidence.task))
        for each in verdicts
    ]
    found = [(each, shares) for each, shares in found if len(shares) > 1][:_MAX_COLUMNS]
    if not found:
        return None
    maximum = max(len(shares) for _, shares in found)
    figure = new_figure(PAGE, 0.9 + 0.22 * maximum)
    panels = figure.subplots(1, len(found), squeeze=False)[0]
    for axes, (verdict, shares) in zip(panels, found, strict=True):
        rows = range(len(shares))
        axes.barh(rows, [100.0 * s.share for s in shares], color="#56b4e9", height=0.62)
        for row, each in enumerate(shares):
            if isfinite(each.low):
                axes.plot([100.0 * each.low, 100.0 * each.high], [row, row], color=DARK, lw=1.0)
        axes.set_yticks(rows, [s.factor for s in shares])
        axes.invert_yaxis()
        axes.set_xlim(0.0, 100.0)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("share of the variance in %")
        axes.set_title(f"{verdict.evidence.measure.label}, {verdict.evidence.task.label}")
    return figure
