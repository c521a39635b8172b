"""Distributions of the compared quantity, and paired differences, of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import DARK, MUTED, PAGE, new_figure, set_log_scale
from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.evaluation.statistics.evidence import (
    BETTER,
    NO_DIFFERENCE,
    WORSE,
    PairEvidence,
    StudyEvidence,
    TaskEvidence,
)
from omnidrive.evaluation.verdict import TaskVerdict

MAX_PANELS = 6
"""Largest number of tasks in one figure."""

_NOISE_ERRORS = ("me_measured", "mae", "mae_measured")
_BINS = 60
_LOG_RATIO = 30.0  # ratio of the largest to the smallest value from which an axis is logarithmic
_COLOURS = {BETTER: "#0072b2", WORSE: "#d55e00", NO_DIFFERENCE: MUTED}
_ALL_PAIRS = 4  # controllers up to which all pairs are drawn, not only those with the best one


def distributions(
    study: StudyEvidence, verdicts: Sequence[TaskVerdict], styles: Mapping[str, ControllerStyle]
) -> Figure | None:
    """Draw one panel per task: density, quartiles and percentiles of every controller."""
    shown = [each for each in verdicts[:MAX_PANELS] if each.evidence.ranking]
    if not shown:
        return None
    rows = max(len(each.evidence.ranking) for each in shown)
    columns = min(len(shown), 2)
    lines = -(-len(shown) // columns)
    figure = new_figure(PAGE, lines * (0.75 + 0.36 * rows))
    panels = figure.subplots(lines, columns, squeeze=False)
    for axes, verdict in zip(panels.flat, shown, strict=False):
        _panel(axes, study, verdict, styles)
    for axes in panels.flat[len(shown) :]:
        axes.axis("off")
    return figure


def _panel(
    axes: Axes, study: StudyEvidence, verdict: TaskVerdict, styles: Mapping[str, ControllerStyle]
) -> None:
    evidence, runs = verdict.evidence, study.runs
    values = runs.values(evidence.measure.name) * evidence.measure.factor
    of_task = (runs.task == runs.tasks.index(evidence.task)) & np.isfinite(values)
    names = [each.controller for each in evidence.ranking]
    every = values[of_task]
    low, high = float(every.min()), float(every.max())
    logarithmic = low > 0.0 and high > _LOG_RATIO * low
    if high <= low:
        low, high = low - 0.5 * max(abs(low), 1.0), high + 0.5 * max(abs(high), 1.0)
    edges = np.geomspace(low, high, _BINS + 1) if logarithmic else np.linspace(low, high, _BINS + 1)
    for row, name in enumerate(names):
        own = values[of_task & (runs.controller == runs.controllers.index(name))]
        _ridge(axes, own, edges, row, styles[name].colour.light)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.55, -0.75)
    if logarithmic:
        set_log_scale(axes, "x")
    axes.set_xlabel(evidence.measure.axis_label)
    axes.set_title(evidence.task.label)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0.0)


def _ridge(
    axes: Axes, values: Float[Array, " runs"], edges: Float[Array, " edges"], row: int, colour: str
) -> None:
    """Draw the density of one controller above its base line, with its quantiles on the line."""
    counts = np.histogram(values, edges)[0].astype(float)
    counts = np.convolve(np.pad(counts, 2, mode="edge"), [0.1, 0.2, 0.4, 0.2, 0.1], "valid")
    heights = row - 0.62 * counts / counts.max()
    middles = np.sqrt(edges[1:] * edges[:-1]) if edges[0] > 0 else 0.5 * (edges[1:] + edges[:-1])
    axes.fill_between(middles, row, heights, color=colour, alpha=0.35, lw=0.0)
    p5, q1, median, q3, p95 = np.percentile(values, [5, 25, 50, 75, 95]).tolist()
    base = row + 0.12
    axes.plot([p5, p95], [base, base], color=colour, lw=1.0)
    axes.plot([q1, q3], [base, base], color=colour, lw=3.4, solid_capstyle="butt")
    axes.plot(median, base, "o", color="white", mec=DARK, mew=0.8, ms=3.6, zorder=4)


def paired_intervals(study: StudyEvidence, verdicts: Sequence[TaskVerdict]) -> Figure | None:
    """Draw the paired differences with their intervals, one panel per task and quantity.

    Quantities are the compared one, and with noise also the other errors.
    """
    every = [each.evidence for each in verdicts]
    also = [name for name in _NOISE_ERRORS if name in study.runs.metrics]
    for task in [each.task for each in every if each.task.name == "noise"]:
        every += [each for name in also for each in study.of(name) if each.task == task]
    found = {(each.task, each.measure): each for each in every}
    shown = [(each, _drawn_pairs(each)) for each in list(found.values())[:MAX_PANELS]]
    shown = [(each, pairs) for each, pairs in shown if pairs]
    if not shown:
        return None
    heights = [0.5 + 0.24 * len(pairs) for _, pairs in shown]
    figure = new_figure(PAGE, sum(heights) + 0.4 * len(shown))
    panels = figure.subplots(len(shown), 1, squeeze=False, height_ratios=heights)[:, 0]
    for axes, (evidence, pairs) in zip(panels, shown, strict=True):
        _forest(axes, evidence, pairs)
    return figure


def _drawn_pairs(evidence: TaskEvidence) -> list[PairEvidence]:
    """Return the pairs with an interval: the better controller first, in the ranking's order."""
    names = [each.controller for each in evidence.ranking]
    firsts = names if len(names) <= _ALL_PAIRS else names[:1]
    pairs = [
        evidence.pair(first, second) for k, first in enumerate(firsts) for second in names[k + 1 :]
    ]
    return [pair for pair in pairs if pair and isfinite(pair.difference.margin)]


def _forest(axes: Axes, evidence: TaskEvidence, pairs: list[PairEvidence]) -> None:
    """Draw one line per pair, with its numbers at the right."""
    measure = evidence.measure
    numbers = axes.secondary_yaxis("right")
    texts = []
    for row, pair in enumerate(pairs):
        low, mean, high = (measure.factor * v for v in (pair.difference.low, pair.difference.mean,
                                                        pair.difference.high))  # fmt: skip
        colour = _COLOURS[pair.verdict]
        axes.plot([low, high], [row, row], color=colour, lw=2.2, solid_capstyle="butt")
        axes.plot(mean, row, "o", color=colour, ms=4.2)
        mean_text, _, low_text, high_text = pair.difference.text(measure.factor)
        texts.append(f"{mean_text} [{low_text}, {high_text}]")
    axes.axvline(0.0, color=DARK, lw=0.8)
    axes.set_yticks(range(len(pairs)), [f"{p.first} − {p.second}" for p in pairs])
    numbers.set_yticks(range(len(pairs)), texts, fontsize=6.5)
    numbers.spines["right"].set_visible(False)
    axes.set_ylim(len(pairs) - 0.4, -0.6)
    for each in (axes, numbers):
        each.tick_params(axis="y", length=0.0)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel(f"difference of {measure.axis_label}")
    axes.set_title(evidence.task.label)
