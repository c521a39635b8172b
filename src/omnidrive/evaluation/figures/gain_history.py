"""Gains and inputs of self-tuning PID controllers over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.evaluation.figures.style import (
    COLUMN,
    MUTED,
    PAGE,
    curve_style,
    legend_above,
    new_figure,
)
from omnidrive.evaluation.palette import ControllerStyle, controller_styles
from omnidrive.evaluation.study_logs import RecordedRun, StudyLogs
from omnidrive.evaluation.tuning import GAINS, INPUTS, TuningSignal, tuning_signals, unit_text


class _History(NamedTuple):
    result: RecordedRun
    tuned: list[TuningSignal]


def gain_history(logs: StudyLogs) -> Figure | None:
    """Draw the gains of the longest runs without noise; if none logs gains, of those with noise.

    None: no run logs gains.
    """
    return _figure(logs, _histories(logs.select("track")) or _histories(logs.select("noise")))


def step_gain_history(logs: StudyLogs) -> Figure | None:
    """Draw the gains during the step responses, where errors and gain changes are large.

    None: no run logs gains.
    """
    return _figure(logs, _histories(logs.select("step")))


def _figure(logs: StudyLogs, histories: list[_History]) -> Figure | None:
    """Draw one row per gain and per fuzzy input, and one column per channel; None: no runs."""
    if not histories:
        return None
    signals = [each for history in histories for each in history.tuned]
    quantities = [q for q in (*GAINS, *INPUTS) if any(each.quantity == q for each in signals)]
    channels = list(dict.fromkeys(each.channel for each in signals))
    styles = controller_styles(logs)
    width = PAGE if len(channels) > 1 else COLUMN
    figure = new_figure(width, 0.9 + 1.25 * len(quantities))
    panels = figure.subplots(
        len(quantities), len(channels), sharex=True, sharey="row", squeeze=False
    )
    for row, quantity in zip(panels, quantities, strict=True):
        for axes, channel in zip(row, channels, strict=True):
            _draw(axes, histories, styles, quantity, channel)
        unit = unit_text(next(each.unit for each in signals if each.quantity == quantity))
        name = INPUTS.get(quantity, quantity).replace(" of ", "\nof ")
        row[0].set_ylabel(f"{name} in {unit}" if unit else f"{name}, no unit")
    for axes, channel in zip(panels[0], channels, strict=True):
        axes.set_title(_title(channel))
    for axes in panels[-1]:
        axes.set_xlabel("time in s")
    figure.align_ylabels(panels[:, 0])
    drawn = [axes for axes in panels.flat if axes.lines]
    # the legend of the panel with the most curves
    legend_above(figure, max(drawn, key=lambda axes: len(axes.get_legend_handles_labels()[1])))
    figure.supxlabel(_caption(histories, logs.repeats), fontsize=7, color=MUTED)
    return figure


def _histories(runs: Sequence[RecordedRun]) -> list[_History]:
    """Return the longest of the runs that log gains: several if their durations are equal."""
    logged = [h for h in (_History(r, tuning_signals(r.log)) for r in runs) if h.tuned]
    longest = max((history.result.duration for history in logged), default=0.0)
    return [history for history in logged if history.result.duration == longest]


def _draw(
    axes: Axes,
    histories: list[_History],
    styles: dict[str, ControllerStyle],
    quantity: str,
    channel: str,
) -> None:
    """Draw one quantity of one channel."""
    for k, (result, tuned) in enumerate(histories):
        for each in tuned:
            if (each.quantity, each.channel) == (quantity, channel):
                style = curve_style(styles[result.controller], k, len(histories), len(result.log.t))
                axes.step(result.log.t, each.values, where="post", label=result.controller, **style)
    axes.margins(x=0.0)
    axes.ticklabel_format(axis="y", useOffset=False)
    low, high = axes.get_ylim()
    if high - low < 1e-6 * max(abs(low), abs(high), 1e-9):  # constant: a range of 1
        axes.set_ylim(low - 0.5, high + 0.5)


def _title(channel: str) -> str:
    return {"x": "x of the robot", "y": "y of the robot"}.get(channel, channel.capitalize())


def _caption(histories: list[_History], repeats: int) -> str:
    """Return a description of the runs and the quantities."""
    result = histories[0].result
    if result.task == "step":
        what = "Step response"
    elif result.task == "noise":
        what = f"{result.duration:g} s with noise" + (
            f", first of {repeats} seeds" if repeats > 1 else ""
        )
    else:
        what = f"{result.duration:g} s without noise"
    return f"{what}. Gains, and the fuzzy-system inputs from which they result."
