"""Path and errors of one run."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.evaluation.figures.style import (
    BLUE,
    DARK,
    DASHED,
    MUTED,
    figure_style,
    legend_above,
    new_figure,
)
from omnidrive.evaluation.measures.metrics import heading_error, position_error
from omnidrive.simulation import Run


def run_figure(run: Run) -> Figure:
    """Draw the path beside the reference, and position and heading error over time.

    Vertical lines mark the events of the run.
    """
    with figure_style():
        figure = new_figure(8.0, 3.6)
        grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.25))
        path = figure.add_subplot(grid[:, 0])
        distance = figure.add_subplot(grid[0, 1])
        turn = figure.add_subplot(grid[1, 1], sharex=distance)
        path.plot(run.pose[:, 0], run.pose[:, 1], color=BLUE, label="Robot")
        path.plot(run.target[:, 0], run.target[:, 1], color=DARK, ls=DASHED, lw=1.0,
                  label="Reference")  # fmt: skip
        path.set(xlabel="x in m", ylabel="y in m")
        path.set_aspect("equal", adjustable="datalim")
        distance.plot(run.t, 1e3 * position_error(run.pose, run.target), color=BLUE)
        distance.set(ylabel="position error in mm", ylim=(0.0, None))
        turn.plot(run.t, 1e3 * heading_error(run.pose, run.target), color=BLUE)
        turn.set(ylabel="heading error in mrad", xlabel="time in s")
        turn.set_xlim(0.0, max(float(run.t[-1]), 1e-3))
        for axes in (distance, turn):
            _events(axes, run)
        distance.tick_params(labelbottom=False)
        legend_above(figure, path)
    return figure


def _events(axes: Axes, run: Run) -> None:
    for t in np.unique([event.t for event in run.events]):
        axes.axvline(t, color=MUTED, lw=0.8, ls=(0, (1, 2)))
