"""Punctuality of a real-time loop."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import (
    BLUE,
    DARK,
    DASHED,
    PAGE,
    figure_style,
    legend_above,
    new_figure,
    set_log_scale,
)

_BINS = 60
_MIN = 1e-3  # ms


def punctuality_figure(
    lateness: Float[Array, " samples"], busy: Float[Array, " samples"], dt: float
) -> Figure:
    """Draw histograms of jitter and computing time, with the sample time.

    Args:
        lateness: Time from the deadline of each sample to its begin, s.
        busy: Time from there until its command is sent, s.
        dt: Sample time, s.
    """
    with figure_style():
        figure = new_figure(PAGE, 2.6)
        panels = figure.subplots(1, 2, sharey=True)
        _histogram(panels[0], lateness, dt)
        panels[0].set(xlabel="from the deadline to the begin in ms", ylabel="samples")
        _histogram(panels[1], busy, dt)
        panels[1].set(xlabel="from the begin until the command is sent in ms")
        legend_above(figure, panels[0])
    return figure


def _histogram(axes: Axes, times: Float[Array, " samples"], dt: float) -> None:
    """Draw a histogram of times, s, over a logarithmic axis in ms."""
    values = np.maximum(1e3 * times, _MIN)
    maximum = max(2e3 * dt, float(values.max(initial=0.0)))
    axes.hist(values, bins=np.geomspace(_MIN, 1.01 * maximum, _BINS).tolist(), color=BLUE)
    axes.axvline(1e3 * dt, color=DARK, ls=DASHED, lw=1.0, label="sample time")
    if times.size:
        p99 = max(1e3 * float(np.percentile(times, 99)), _MIN)
        axes.axvline(p99, color=DARK, lw=0.8, label="99th percentile")
    set_log_scale(axes, "x")
    axes.set_yscale("symlog", linthresh=1.0)
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_ylim(0.0, None)
