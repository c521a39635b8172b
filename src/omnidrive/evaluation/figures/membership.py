"""Membership functions of fuzzy variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import DARK, MUTED, PAGE, figure_style, new_figure
from omnidrive.fuzzy import FuzzySet, FuzzySystem, InputVariable, LinearFunction, OutputVariable
from omnidrive.fuzzy.sets import ZSlice, membership_bounds

COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#4d4d4d", "#e69f00", "#d55e00", "#cc79a7")
"""Colours of the sets of a variable, repeated in this order."""


_MAX_LABELS = 60  # with more sets, only their number is shown
_MAX_ROWS = 4  # of names above the functions
_GROUND = {"boxstyle": "square,pad=0.05", "fc": "white", "ec": "none"}
_LEVELS = (0.25, 0.5, 0.75)  # drawn levels of the secondary functions


def membership_functions(systems: Mapping[str, FuzzySystem]) -> Figure:
    """Draw the sets of the inputs and outputs of the fuzzy systems in use.

    Systems with equal sets, and variables with equal sets, share a panel.

    Args:
        systems: Gain-tuning system of each fuzzy controller, by label.
    """
    users: list[tuple[FuzzySystem, list[str]]] = []
    for label, system in systems.items():
        same = (names for each, names in users if _sets_of(each) == _sets_of(system))
        found = next(same, None)
        if found is None:
            users.append((system, [label]))
        else:
            found.append(label)
    types = [system.type for system, _ in users]
    rows: list[tuple[str, _Panel | None, _Panel | None]] = []
    for system, labels in users:
        name = _TYPES[system.type]
        if types.count(system.type) > 1:
            name = f"{truncate(', '.join(labels), 30)}: {name[0].lower()}{name[1:]}"
        rows += [
            (name, *pair) for pair in zip_longest(_equal(system.inputs), _equal(system.outputs))
        ]
    figure = new_figure(PAGE, 1.9 * len(rows))
    panels = figure.subplots(len(rows), 2, sharey=True, squeeze=False)
    for (left, right), (name, inputs, outputs) in zip(panels, rows, strict=True):
        left.set_ylabel("degree of membership")
        _draw_panel(left, inputs, f"{name} sets of the inputs")
        _draw_panel(right, outputs, f"{name} sets of the outputs", "change of gain ")
    return figure


_TYPES = {1: "Type-1", 2: "Interval type-2", 3: "Interval type-3"}
_NAMES = {"error": "scaled error e", "derror": "change of error de"}
_Panel = Sequence[InputVariable | OutputVariable]


def _sets_of(system: FuzzySystem) -> tuple[object, ...]:
    return system.type, system.inputs, system.outputs


def _equal(variables: _Panel) -> list[_Panel]:
    """Group variables with equal sets."""
    groups: list[list[InputVariable | OutputVariable]] = []
    for variable in variables:
        same = (group for group in groups if group[0].sets == variable.sets)
        found = next(same, None)
        if found is None:
            groups.append([variable])
        else:
            found.append(variable)
    return list(groups)


def _draw_panel(axes: Axes, variables: _Panel | None, title: str, prefix: str = "") -> None:
    if variables is None:
        axes.set_axis_off()
        return
    draw_sets(axes, variables[0], 3.0)
    names = ", ".join(_NAMES.get(each.name, each.name) for each in variables)
    axes.set(title=title, xlabel=prefix + names)
    if prefix:
        axes.locator_params(axis="x", nbins=5)


def membership_figure(
    variable: InputVariable | OutputVariable, *, unit: str = "", inputs: Sequence[str] = ()
) -> Figure:
    """Draw the sets of a variable with their footprints, or the functions of a Sugeno output.

    Args:
        variable: Variable of a fuzzy system of any type.
        unit: Unit of its values, for the axis label.
        inputs: Names of the inputs, for linear functions of a Sugeno output; otherwise x1, x2, ...
    """
    with figure_style():
        figure = new_figure(PAGE, 2.9)
        axes = figure.add_subplot()
        axes.set_title(truncate(variable.name, 60))
        axes.set_xlabel(truncate(variable.name, 60) + (f" in {unit}" if unit else ""))
        if isinstance(variable, OutputVariable) and variable.is_sugeno:
            _draw_functions(axes, variable, inputs)
        else:
            draw_sets(axes, variable, 6.2)
            axes.set_ylabel("degree of membership")
    return figure


def truncate(name: str, maximum: int = 16) -> str:
    """Truncate a name to at most ``maximum`` characters."""
    return name if len(name) <= maximum else name[: maximum - 1] + "…"


def draw_sets(axes: Axes, variable: InputVariable | OutputVariable, width: float) -> None:
    """Draw upper and lower membership functions of a variable and the footprints between them.

    Args:
        axes: Target axes.
        variable: Variable with fuzzy sets.
        width: Approximate width of the axes, inches; used to keep the names apart.
    """
    sets = [each for each in variable.sets if isinstance(each, FuzzySet)]
    at = sample_points(variable)
    names = []
    for k, (each, low, high) in enumerate(zip(sets, *membership_bounds(sets, at), strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        axes.plot(at, high, color=colour, lw=1.4)
        if each.lower is not None:
            axes.fill_between(at, low, high, color=colour, alpha=0.25, lw=0.0)
            axes.plot(at, low, color=colour, lw=0.9, ls=(0, (3, 1.5)))
        if each.secondary is not None:
            for level in _LEVELS:
                (inner,), (outer,) = membership_bounds([each], at, ZSlice(level, of_lower=False))
                axes.fill_between(at, inner, outer, color=colour, alpha=0.15, lw=0.0)
        top = float(high.max())
        if top > 0.0:
            peak = float(at[high >= top - 1e-9].mean())
            names.append(_Name(truncate(each.name), colour, peak, top))
    axes.set_xlim(variable.low, variable.high)
    rows = _draw_names(axes, names, width, variable.high - variable.low)
    axes.set_ylim(0.0, 1.03 + 0.11 * rows)
    axes.set_yticks([0.0, 0.5, 1.0])


def sample_points(variable: InputVariable | OutputVariable) -> Array:
    """Return the sample points of a variable: a grid, and every vertex of its sets."""
    at = [np.linspace(variable.low, variable.high, 1001)]
    for each in variable.sets:
        if isinstance(each, FuzzySet) and each.upper.is_piecewise_linear:
            at.append(np.array([x for x, _ in each.upper.vertices]))
    return np.unique(np.clip(np.concatenate(at), variable.low, variable.high))


class _Name(NamedTuple):
    text: str
    colour: str
    at: float
    top: float


def _draw_names(axes: Axes, names: list[_Name], width: float, span: float) -> int:
    """Draw the names above their sets, without overlap; return the number of rows."""
    if len(names) > _MAX_LABELS:
        middle = 0.5 * sum(axes.get_xlim())
        axes.text(middle, 1.02, f"{len(names)} sets", ha="center", va="bottom", color=DARK)
        return 1
    size = 8.0 if len(names) <= 12 else 7.0
    char_width = 0.66 * size / 72.0 / width * span  # width of a bold character, in units of x
    taken: list[float] = []  # right end of each row
    for name in sorted(names, key=lambda each: each.at):
        half = 0.5 * char_width * len(name.text)
        row = next((r for r, end in enumerate(taken) if name.at - half > end), len(taken))
        if row == len(taken):
            if row == _MAX_ROWS:  # no row left: omit the name
                continue
            taken.append(0.0)
        taken[row] = name.at + half + char_width
        y = 1.02 + 0.11 * row
        if row or name.top < 0.99:
            axes.plot([name.at, name.at], [name.top, y], color=MUTED, lw=0.4, zorder=1)
        axes.annotate(name.text, (name.at, y), (0, 1), textcoords="offset points", ha="center",
                      va="bottom", color=name.colour, fontsize=size, fontweight="bold",
                      bbox=_GROUND)  # fmt: skip
    return len(taken)


def _draw_functions(axes: Axes, variable: OutputVariable, inputs: Sequence[str]) -> None:
    """Draw the functions of a Sugeno output: constants as lines, linear functions as text."""
    functions = [each for each in variable.sets if isinstance(each, LinearFunction)]
    constants = [each for each in functions if not any(each.coefficients)]
    linear = [each for each in functions if any(each.coefficients)]
    values = [each.constant for each in constants]
    low, high = min([variable.low, *values]), max([variable.high, *values])
    margin = 0.04 * (high - low)
    names = []
    for k, each in enumerate(constants):
        colour = COLOURS[k % len(COLOURS)]
        axes.plot([each.constant] * 2, [0.0, 1.0], color=colour, lw=1.6)
        names.append(_Name(truncate(each.name), colour, each.constant, 1.0))
    rows = _draw_names(axes, names, 6.2, high - low) if names else 1
    axes.set_xlim(low - margin, high + margin)
    axes.set_ylim(0.0, 1.03 + 0.11 * rows)
    axes.set_yticks([])
    if linear:
        formulas = [_formula(each, inputs) for each in linear[:8]]
        if len(linear) > 8:
            formulas.append(f"and {len(linear) - 8} more")
        axes.set_xlabel("\n".join((axes.get_xlabel(), *formulas)))


def _formula(each: LinearFunction, inputs: Sequence[str]) -> str:
    parts = [f"{each.constant:g}"] if each.constant else []
    names = [truncate(name) for name in inputs] or [
        f"x{k}" for k in range(1, len(each.coefficients) + 1)
    ]
    parts += [f"{c:g} {x}" for c, x in zip(each.coefficients, names, strict=False) if c]
    shown = " + ".join(parts[:8]).replace("+ -", "− ")
    return f"{truncate(each.name)} = {shown}{' + ...' if len(parts) > 8 else ''}"
