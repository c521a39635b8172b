"""Figure of the step responses."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.evaluation.figures.style import (
    DARK,
    DASHED,
    MUTED,
    PAGE,
    curve_style,
    legend_above,
    new_figure,
)
from omnidrive.evaluation.palette import controller_styles
from omnidrive.evaluation.study_logs import RecordedRun, StudyLogs

_BEFORE = -0.06  # start of the time axis relative to its end, before the step
_LABELS = ("x in m", "y in m", "heading in rad")


def step_response(logs: StudyLogs) -> Figure | None:
    """Draw the responses in x, y and heading to a simultaneous step of all three."""
    steps = logs.select("step")
    if not steps:
        return None
    figure, styles = new_figure(PAGE, 2.6), controller_styles(logs)
    panels = figure.subplots(1, 3)
    end = _end(steps)
    for axis, axes in enumerate(panels):
        _command(axes, steps[0], axis, end)
        for k, step in enumerate(steps):
            style = curve_style(
                styles[step.controller], k, len(steps), int(np.sum(step.log.t <= end))
            )
            axes.plot(step.log.t, step.log.pose[:, axis], label=step.controller, **style)
        axes.set(xlabel="time in s", ylabel=_LABELS[axis])
        axes.set_xlim(_BEFORE * end, end)
    legend_above(figure, panels[0])
    return figure


def _end(steps: tuple[RecordedRun, ...]) -> float:
    """Return the end of the time axis, s: 1.5 times the longest settling time to within 2 %."""
    last = 0.0
    for step in steps:
        run = step.log
        off = np.abs(run.pose - run.target) > 0.02 * np.abs(run.target[-1] - run.pose[0])
        last = max(last, float(run.t[off.any(axis=1)].max(initial=0.0)))
    whole = min(float(step.log.t[-1]) for step in steps)
    end = min(1.5 * last, whole) or whole
    return end if end > 0.0 else 1.0  # all runs failed at once


def _command(axes: Axes, step: RecordedRun, axis: int, end: float) -> None:
    """Draw the command, dashed, and the +-10 % band of the settling time."""
    start, goal = float(step.log.pose[0, axis]), float(step.log.target[-1, axis])
    band = 0.1 * abs(goal - start)
    axes.fill_between([0.0, end], goal - band, goal + band, color=MUTED, alpha=0.16, lw=0.0)
    axes.annotate("±10 %", (end, goal - band), (-2, -2), textcoords="offset points", color=MUTED,
                  ha="right", va="top" if goal >= start else "bottom", fontsize=7.5)  # fmt: skip
    times = np.array([_BEFORE * end, 0.0, 0.0, end])
    values = np.array([start, start, goal, goal])
    axes.plot(times, values, color=DARK, ls=DASHED, lw=1.0, label="Command", zorder=40)
