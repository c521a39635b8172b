"""Error against computing time of the controllers of a study, with the Pareto front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.evaluation.figures.style import MUTED, PAGE, legend_above, new_figure, set_log_scale
from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.statistics.uncertainty import MeanEstimate
from omnidrive.evaluation.verdict import TaskVerdict

TIME = "step_time_median"
"""Metric of the computing time."""

_MAX_PANELS = 2


class CostPoint(NamedTuple):
    """Computing time and error of one controller."""

    controller: str
    time: MeanEstimate
    """Mean over the repetitions of the median time of a step, us."""
    error: MeanEstimate
    """Mean of the compared quantity, in its stored unit."""


def cost_points(study: StudyEvidence, verdict: TaskVerdict) -> list[CostPoint]:
    """Return time and error of every controller that has both; empty without times."""
    if TIME not in study.runs.metrics:
        return []
    task = verdict.evidence.task
    times = {s.controller: s.mean for e in study.of(TIME) if e.task == task for s in e.summaries}
    points = [
        CostPoint(s.controller, times[s.controller], s.mean)
        for s in verdict.evidence.ranking
        if s.controller in times
    ]
    return [each for each in points if isfinite(each.time.mean) and each.time.mean > 0.0]


def pareto_front(points: Sequence[CostPoint], *, lower_is_better: bool = True) -> list[CostPoint]:
    """Return the points that no other one beats in time and error, by increasing time."""
    sign = 1.0 if lower_is_better else -1.0
    front: list[CostPoint] = []
    for each in sorted(points, key=lambda p: (p.time.mean, sign * p.error.mean)):
        if not front or sign * each.error.mean < sign * front[-1].error.mean:
            front.append(each)
    return front


def error_and_time(
    study: StudyEvidence, verdicts: Sequence[TaskVerdict], styles: Mapping[str, ControllerStyle]
) -> Figure | None:
    """Draw the means with their intervals, and the Pareto front, a panel per task."""
    shown = [(each, cost_points(study, each)) for each in verdicts]
    shown = [(each, points) for each, points in shown if len(points) > 1][:_MAX_PANELS]
    if not shown:
        return None
    figure = new_figure(PAGE, 2.8)
    panels = figure.subplots(1, len(shown), squeeze=False)[0]
    for axes, (verdict, points) in zip(panels, shown, strict=True):
        _panel(axes, verdict, points, styles)
    legend_above(figure, panels[0])
    return figure


def _panel(
    axes: Axes,
    verdict: TaskVerdict,
    points: Sequence[CostPoint],
    styles: Mapping[str, ControllerStyle],
) -> None:
    measure = verdict.evidence.measure
    front = pareto_front(points, lower_is_better=measure.lower_is_better)
    axes.plot(
        [p.time.mean for p in front], [measure.factor * p.error.mean for p in front],
        color=MUTED, lw=1.0, drawstyle="steps-post", zorder=1,
    )  # fmt: skip
    for p in points:
        style, x, y = styles[p.controller], p.time.mean, measure.factor * p.error.mean
        if isfinite(p.error.margin):
            axes.plot([x, x], [measure.factor * p.error.low, measure.factor * p.error.high],
                      color=style.colour.light, lw=1.6)  # fmt: skip
        filled = style.colour.light if p in front else "white"
        axes.plot(x, y, marker=style.marker, color=style.colour.light, mfc=filled, ms=5.5, ls="",
                  label=p.controller)  # fmt: skip
    values = [p.error.mean for p in points]
    if min(values) > 0.0 and max(values) > 10.0 * min(values):
        set_log_scale(axes, "y")
    set_log_scale(axes, "x")
    axes.margins(x=0.1, y=0.1)
    axes.set_xlabel("computing time of a step in µs")
    axes.set_ylabel(measure.axis_label)
    axes.set_title(verdict.evidence.task.label)
