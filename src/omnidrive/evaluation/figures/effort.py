"""Wheel speeds and control effort of the controllers over time."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import (
    DARK,
    DASHED,
    PAGE,
    curve_style,
    legend_above,
    new_figure,
    set_log_scale,
)
from omnidrive.evaluation.measures.metrics import START_PHASE, commanded_wheel_speeds
from omnidrive.evaluation.palette import controller_styles
from omnidrive.evaluation.study_logs import StudyLogs
from omnidrive.simulation import Run

_WINDOW = 1.0  # s; of the moving mean of the wheel accelerations


class _Curve(NamedTuple):
    label: str
    style: dict[str, Any]
    run: Run
    speeds: Float[Array, "rows wheels"]
    """True wheel speeds; the commanded ones if the plant does not report them, rad/s."""
    commands: Float[Array, "rows wheels"]
    """Commanded wheel speeds, rad/s."""


def effort(logs: StudyLogs) -> Figure | None:
    """Draw wheel speeds, wheel acceleration and work of the shortest, fastest tracking runs.

    The wheel speeds of the first 2 s, in which the robot accelerates, have a scale of their own.
    None: there are no runs of the tasks ``track`` and ``noise``.
    """
    runs = logs.select("track") or logs.select("noise")
    if not runs:
        return None
    fastest = min(r.duration for r in runs)
    runs = tuple(r for r in runs if r.duration == fastest)
    styles = controller_styles(logs)
    curves = []
    for k, r in enumerate(runs):
        commands = commanded_wheel_speeds(r.log, logs.robot.drive)
        commands[-1] = np.nan
        speeds = r.log.wheel_speed if r.log.wheel_speed.shape[1] else commands
        style = curve_style(styles[r.controller], k, len(runs), len(r.log.t))
        curves.append(_Curve(r.controller, style, r.log, speeds, commands))
    wheels = len(logs.robot.mounts)
    figure = new_figure(PAGE, 1.7 + 0.95 * wheels)
    panels = figure.subplots(
        wheels + 1, 2, width_ratios=(1.0, 1.6), height_ratios=[*([1.0] * wheels), 1.4]
    )
    for i in range(wheels):
        _draw_wheel(panels[i], curves, i, logs.robot.max_wheel_speed)
        if i < wheels - 1:
            panels[i, 0].tick_params(labelbottom=False)
            panels[i, 1].tick_params(labelbottom=False)
    panels[0, 0].set_title(f"Wheel speeds in rad/s: first {START_PHASE:g} s")
    panels[0, 1].set_title("Rest")
    _draw_effort(panels[-1], curves)
    figure.align_ylabels(panels[:, 0])
    legend_above(figure, panels[0, 0])
    return figure


def _draw_wheel(panels: Array, curves: list[_Curve], i: int, limit: float) -> None:
    """Draw the speed of one wheel: the start on the left, the rest on the right."""
    for label, style, run, speeds, _ in curves:
        late = run.t >= START_PHASE
        for axes, rows in zip(panels, (~late, late), strict=True):
            axes.plot(run.t[rows], speeds[rows, i], label=label, **style)
    for axes in panels:
        _draw_limits(axes, limit)
        axes.margins(x=0.0)
        axes.locator_params(axis="y", nbins=4)
    panels[0].set_ylabel(f"wheel {i}")


def _draw_limits(axes: Axes, limit: float) -> None:
    """Draw the largest wheel speed, if the curves come near to it."""
    low, high = axes.get_ylim()
    if np.isfinite(limit) and max(-low, high) > 0.7 * limit:
        for sign in (-1.0, 1.0):
            axes.axhline(sign * limit, color=DARK, ls=DASHED, lw=0.8)


def _draw_effort(panels: Array, curves: list[_Curve]) -> None:
    """Draw the moving mean of the wheel accelerations, and the work if the plant has forces."""
    acceleration, work = panels
    for _, style, run, _, commands in curves:
        rate = _mean_acceleration(run.t, commands)
        acceleration.plot(run.t[1:], np.where(rate > 0.0, rate, np.nan), **style)
        work.plot(run.t, run.work, **style)
    set_log_scale(acceleration, "y")
    acceleration.set_ylabel("rad/s²")
    acceleration.set_title(f"Commanded acceleration, mean of {_WINDOW:g} s")
    work.set_ylabel("J")
    work.set_title("Mechanical work")
    for axes in panels:
        axes.set_xlabel("time in s")
        axes.margins(x=0.0)
    if not any(np.isfinite(run.work).any() for _, _, run, _, _ in curves):
        work.set_visible(False)


def _mean_acceleration(
    t: Float[Array, " rows"], commands: Float[Array, "rows wheels"]
) -> Float[Array, " intervals"]:
    """Return the moving mean of the absolute rate of change of the commands, rad/s^2."""
    if len(t) < 2:
        return np.zeros(0)
    change = np.abs(np.diff(commands[:-1], axis=0, prepend=0.0)).mean(axis=1)
    dt = np.diff(t)
    window = np.ones(min(max(round(_WINDOW / float(dt.mean())), 1), len(dt)))
    rate, count = (
        np.convolve(values, window, "same")[: len(dt)] for values in (change / dt, np.ones(len(dt)))
    )
    smoothed: Float[Array, " intervals"] = rate / count
    return smoothed
