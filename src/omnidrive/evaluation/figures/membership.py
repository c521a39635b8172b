"""Membership functions of the paper's fuzzy sets."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.control.pid.sets import INPUT_SETS, OUTPUT_SETS, Footprint, lagged
from omnidrive.evaluation.figures.style import canvas

Array = np.ndarray

_NAMES = ("NB", "NM", "NS", "ZO", "PS", "PM", "PB")
_COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#4d4d4d", "#e69f00", "#d55e00", "#cc79a7")
_TYPE_1 = Footprint(scale=1.0, lag=0.0)
_TYPE_2 = Footprint(scale=1.0, lag=0.3)  # the paper, section "FuzzyPID controller"


def membership_functions() -> Figure:
    """Sets of inputs and outputs, type-1 above, type-2 with its footprint below."""
    figure = canvas(8.6, 4.4)
    panels = figure.subplots(2, 2, sharey=True)
    rows = ((_TYPE_1, "Type-1"), (_TYPE_2, "Interval type-2"))
    columns = (
        (INPUT_SETS, "inputs", "scaled error e, change of error de"),
        (OUTPUT_SETS, "outputs", "change of gain kp, ki, kd"),
    )
    for row, (footprint, kind) in zip(panels, rows, strict=True):
        for axes, (sets, role, variable) in zip(row, columns, strict=True):
            _sets(axes, sets, footprint)
            axes.set_title(f"{kind} sets of the {role}")
            axes.set_xlabel(variable)
        row[0].set_ylabel("degree of membership")
    return figure


def _sets(axes: Axes, sets: Float[Array, "sets 3"], footprint: Footprint) -> None:
    """One variable: upper functions, lower functions and what lies between."""
    lower = lagged(sets, footprint)
    for name, colour, outer, inner in zip(_NAMES, _COLOURS, sets, lower, strict=True):
        a, b, c = outer
        d, _, e = inner
        height = footprint.scale
        axes.plot([a, b, c], [0.0, 1.0, 0.0], color=colour, lw=1.4)
        if inner.tolist() != outer.tolist() or height < 1.0:
            axes.fill([a, b, c, e, b, d], [0.0, 1.0, 0.0, 0.0, height, 0.0], color=colour,
                      alpha=0.25, lw=0.0)  # fmt: skip
            axes.plot([d, b, e], [0.0, height, 0.0], color=colour, lw=0.9, ls=(0, (3, 1.5)))
        axes.annotate(name, (b, 1.0), (0, 3), textcoords="offset points", ha="center", color=colour,
                      fontsize=8, fontweight="bold")  # fmt: skip
    axes.set_xlim(sets.min(), sets.max())
    axes.set_ylim(0.0, 1.14)
    axes.set_yticks([0.0, 0.5, 1.0])
