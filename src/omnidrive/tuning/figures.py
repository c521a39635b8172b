"""Figures of tuning: the objective over the trials, and the front of two objectives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from omnidrive.evaluation.figures.style import (
    BLUE,
    DARK,
    DASHED,
    GREEN,
    MUTED,
    PAGE,
    figure_style,
    new_figure,
)
from omnidrive.tuning.objective import Objective
from omnidrive.tuning.optimizers import front
from omnidrive.tuning.search import Trial


def progress_figure(objectives: Sequence[Objective], trials: Sequence[Trial]) -> Figure:
    """Draw each objective of every trial that keeps the limits, and the best one so far."""
    with figure_style():
        figure = new_figure(PAGE, 1.0 + 1.8 * len(objectives))
        panels = figure.subplots(len(objectives), sharex=True, squeeze=False)[:, 0]
        values = np.array([each.score.objectives for each in trials], dtype=float)
        values[[each.score.violation > 0.0 for each in trials]] = np.nan
        for k, (axes, objective) in enumerate(zip(panels, objectives, strict=True)):
            numbers = np.arange(len(trials))
            axes.plot(numbers, values[:, k], ".", ms=3.0, color=MUTED, label="trial")
            best = np.fmin.accumulate(values[:, k])
            axes.step(numbers, best, where="post", color=BLUE, label="best so far")
            if np.isfinite(values[0, k]):
                axes.axhline(values[0, k], color=DARK, ls=DASHED, lw=0.8, label="before tuning")
            finite = values[np.isfinite(values[:, k]), k]
            if len(finite) and finite.min() > 0.0 and finite.max() > 5.0 * finite.min():
                axes.set_yscale("log")
            axes.set_ylabel(str(objective), wrap=True)
        panels[-1].set_xlabel("trial")
        panels[0].legend(loc="upper right")
    return figure


def front_figure(objectives: Sequence[Objective], trials: Sequence[Trial], chosen: int) -> Figure:
    """Draw the first two objectives of all trials that keep the limits, and their front.

    Args:
        objectives: The objectives.
        trials: The trials.
        chosen: Number of the chosen trial.
    """
    with figure_style():
        figure = new_figure(0.75 * PAGE, 0.55 * PAGE)
        axes = figure.subplots()
        kept = [each for each in trials if each.score.violation == 0.0]
        points = np.array([each.score.objectives[:2] for each in kept]).reshape(-1, 2)
        axes.plot(*points.T, ".", ms=3.0, color=MUTED, label="trial")
        best = np.array([kept[i].score.objectives[:2] for i in front([e.score for e in kept])])
        if len(best):
            axes.plot(*best.T, "o-", ms=3.5, color=BLUE, label="front")
        for number, label, colour, marker in (
            (0, "before tuning", DARK, "s"), (chosen, "compromise", GREEN, "D"),
        ):  # fmt: skip
            each = trials[number].score.objectives
            axes.plot(each[0], each[1], marker, ms=6.0, mfc="none", color=colour, label=label)
        if len(points) and (points > 0.0).all():
            for scale, column in ((axes.set_xscale, 0), (axes.set_yscale, 1)):
                if points[:, column].max() > 5.0 * points[:, column].min():
                    scale("log")
        axes.set_xlabel(str(objectives[0]))
        axes.set_ylabel(str(objectives[1]))
        axes.legend(loc="upper right")
    return figure
