"""Membership functions of fuzzy variables."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.control.pid import gain_inference
from omnidrive.evaluation.figures.style import canvas
from omnidrive.fuzzy import FuzzySet, InputVariable, OutputVariable
from omnidrive.fuzzy.sets import bounds

_COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#4d4d4d", "#e69f00", "#d55e00", "#cc79a7")


def membership_functions() -> Figure:
    """Sets of the paper's inputs and outputs, type-1 above, type-2 with its footprint below."""
    figure = canvas(8.6, 4.4)
    panels = figure.subplots(2, 2, sharey=True)
    systems = (gain_inference("t1", "paper").system, gain_inference("t2", "paper").system)
    for (left, right), system in zip(panels, systems, strict=True):
        title = "Type-1" if system.type == 1 else "Interval type-2"
        draw_sets(left, system.inputs[0])
        left.set(title=f"{title} sets of the inputs", ylabel="degree of membership")
        left.set_xlabel("scaled error e, change of error de")
        draw_sets(right, system.outputs[0])
        right.set(title=f"{title} sets of the outputs", xlabel="change of gain kp, ki, kd")
    return figure


def draw_sets(axes: Axes, variable: InputVariable | OutputVariable) -> None:
    """One variable: upper functions, lower functions and what lies between."""
    sets = [each for each in variable.sets if isinstance(each, FuzzySet)]
    at = np.linspace(variable.low, variable.high, 1001)
    for k, (each, low, high) in enumerate(zip(sets, *bounds(sets, at), strict=True)):
        colour = _COLOURS[k % len(_COLOURS)]
        axes.plot(at, high, color=colour, lw=1.4)
        if each.lower is not None:
            axes.fill_between(at, low, high, color=colour, alpha=0.25, lw=0.0)
            axes.plot(at, low, color=colour, lw=0.9, ls=(0, (3, 1.5)))
        peak = float(at[high >= high.max() - 1e-9].mean())
        axes.annotate(each.name, (peak, 1.0), (0, 3), textcoords="offset points", ha="center",
                      color=colour, fontsize=8, fontweight="bold")  # fmt: skip
    axes.set_xlim(variable.low, variable.high)
    axes.set_ylim(0.0, 1.14)
    axes.set_yticks([0.0, 0.5, 1.0])
