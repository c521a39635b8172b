"""Rule viewer: the fired rules of a fuzzy system, their consequents and the output values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, suggestion
from omnidrive.evaluation.figures.membership import sample_points, truncate
from omnidrive.evaluation.figures.style import BLUE, DARK, MUTED, RED, figure_style, new_figure
from omnidrive.fuzzy import (
    FiredRule,
    FuzzySet,
    Inference,
    InputVariable,
    Is,
    LinearFunction,
    OutputVariable,
)
from omnidrive.fuzzy.aggregated_output import aggregated_outputs, implied_consequent, widest_slice
from omnidrive.fuzzy.norms import HEDGE_CODES, apply_hedge
from omnidrive.fuzzy.rules import propositions
from omnidrive.fuzzy.sets import membership_bounds

_INPUT, _OUTPUT, _VALUE = BLUE, "#e69f00", RED
_GROUND = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.75}
_RULES, _INPUTS, _OUTPUTS = 25, 4, 4  # maximum numbers in one figure
_ROW, _ROWS = 0.72, 10.0  # maximum heights of a rule and of all rules, inches


def rule_viewer(
    inference: Inference, inputs: Mapping[str, float] | Sequence[float] | None = None
) -> Figure:
    """Draw the rules of a system for given inputs, and the resulting outputs.

    All rules are drawn in their order, as in Matlab's ``ruleview``, up to 25. Of a longer list, the
    25 strongest that fire are drawn, strongest first, and the figure states so.

    Each row is a rule: the sets of its antecedent with the membership degree of the input, and its
    consequents, clipped or scaled by the firing strength. The last row is the aggregated output
    with its value and, for type 2, the type-reduced interval. For type 3 the widest slice is drawn.

    Args:
        inference: Fuzzy system with its inference options.
        inputs: One value per input, by name or in order; None: the middle of each range.

    Raises:
        InvalidInput: An input is missing, unknown or rejected by the inference.
    """
    x = _ordered(inference, inputs)
    system = inference.system
    fired = inference.fired_rules(*x)
    shown = _drawn_rules(inference, fired)
    ins, outs = system.inputs[:_INPUTS], system.outputs[:_OUTPUTS]
    values = [
        min(max(value, v.low), v.high) if inference.options.out_of_range == "clamp" else value
        for v, value in zip(system.inputs, x, strict=True)
    ]
    with figure_style():
        rows, columns = len(shown) + 1, len(ins) + len(outs)
        height = min(_ROW, _ROWS / max(len(shown), 1))
        figure = new_figure(max(0.6 + 1.6 * columns, 4.6), 2.1 + height * len(shown))
        ratios = [height] * len(shown) + [1.6 * _ROW]
        panels = figure.subplots(rows, columns, squeeze=False, height_ratios=ratios)
        for k, variable in enumerate(ins):
            panels[0, k].set_title(_with_value(variable.name, values[k]), fontsize=8.5)
            for row, each in enumerate(shown):
                _draw_antecedent(panels[row, k], inference, variable, each, values[k])
            panels[-1, k].axis("off")
        for o in range(len(outs)):
            column = panels[:, len(ins) + o]
            column[0].set_title(truncate(outs[o].name), fontsize=8.5)
            for row, each in enumerate(shown):
                _draw_consequent(column[row], inference, o, each, values)
        _draw_results(panels[-1, len(ins) :].tolist(), inference, x, values)
        for row, each in enumerate(shown):
            _label_rule(panels[row, 0], each)
        _set_axes(panels, len(ins))
        omissions = _omission_note(inference, len(fired))
        note = panels[-1, 0]
        note.text(0.0, 0.9, omissions, transform=note.transAxes, va="top", fontsize=7.5, color=DARK)
    return figure


def _drawn_rules(inference: Inference, fired: list[FiredRule]) -> list[FiredRule]:
    """Return all rules in their order; of a long list the strongest that fire."""
    rules = inference.system.rules
    if len(rules) > _RULES:
        return fired[:_RULES]
    strengths = {each.number: each for each in fired}
    return [strengths.get(k, FiredRule(k, rule, 0.0, 0.0)) for k, rule in enumerate(rules, 1)]


def _ordered(
    inference: Inference, inputs: Mapping[str, float] | Sequence[float] | None
) -> list[float]:
    variables = inference.system.inputs
    if inputs is None:
        return [0.5 * (v.low + v.high) for v in variables]
    if not isinstance(inputs, Mapping):
        return [float(each) for each in inputs]
    names = [v.name for v in variables]
    for name in inputs:
        if name not in names:
            raise InvalidInput(f"there is no input {name!r}{suggestion(name, names)}")
    for name in names:
        if name not in inputs:
            raise InvalidInput(f"the input {name!r} is missing")
    return [float(inputs[name]) for name in names]


def _with_value(name: str, value: float) -> str:
    return f"{truncate(name)} = {value:.4g}"


def _omission_note(inference: Inference, fired: int) -> str:
    """Return a description of what the figure omits."""
    system = inference.system
    lines = []
    if fired == 0:
        lines.append("no rule fires")
    elif len(system.rules) > _RULES:
        which = f"the {_RULES} strongest of {fired}" if fired > _RULES else f"the {fired}"
        lines.append(f"{which} that fire\nof {len(system.rules)} rules, strongest first")
    if len(system.inputs) > _INPUTS:
        lines.append(f"and {len(system.inputs) - _INPUTS} more inputs")
    if len(system.outputs) > _OUTPUTS:
        lines.append(f"and {len(system.outputs) - _OUTPUTS} more outputs")
    if not system.is_sugeno and inference.options.reduction == "cos":
        lines.append("outputs: centre of sets,\nnot area centroid")
    if system.type == 3:
        lines.append(f"slice at level {widest_slice(inference).level:g}")
    return "\n".join(lines)


def _label_rule(axes: Axes, each: FiredRule) -> None:
    strength = f"{each.upper:.3g}"
    if each.lower != each.upper:
        strength = f"{each.lower:.3g} to {strength}"
    axes.set_ylabel(
        f"rule {each.number}\n{strength}", rotation=0, ha="right", va="center", fontsize=7.5
    )


def _draw_antecedent(
    axes: Axes, inference: Inference, variable: InputVariable, fired: FiredRule, value: float
) -> None:
    """Draw the sets of one input in an antecedent, filled up to the degree of its value."""
    used = [term for term in propositions(fired.rule.antecedent) if term.variable == variable.name]
    at = sample_points(variable)
    for term in used:
        low, high = _degrees(inference, variable, term, at)
        (minimum,), (maximum,) = _degrees(inference, variable, term, np.array([value]))
        axes.plot(at, high, color=_INPUT, lw=1.0)
        axes.fill_between(at, np.minimum(high, maximum), color=_INPUT, alpha=0.18, lw=0.0)
        if inference.system.type > 1:
            axes.plot(at, low, color=_INPUT, lw=0.7, ls=(0, (3, 1.5)))
            axes.fill_between(at, np.minimum(low, minimum), color=_INPUT, alpha=0.3, lw=0.0)
    axes.axvline(value, color=_VALUE, lw=1.0)
    _name(axes, " / ".join(_term_text(term) for term in used[:2]) or "—")
    axes.set_xlim(variable.low, variable.high)


def _degrees(
    inference: Inference, variable: InputVariable, term: Is, at: Array
) -> tuple[Array, Array]:
    """Return the lower and upper degree of each point, with the hedges of the term applied."""
    named = [each for each in variable.sets if each.name == term.set]
    if not named:  # "any"
        return np.ones_like(at), np.ones_like(at)
    (low,), (high,) = membership_bounds(named, at, widest_slice(inference))
    for hedge in reversed(term.hedges):
        low, high = (
            np.array([apply_hedge(HEDGE_CODES[hedge], v) for v in each.tolist()])
            for each in (low, high)
        )
        if hedge == "not":
            low, high = high, low
    return low, high


def _term_text(term: Is) -> str:
    return " ".join((*term.hedges, truncate(term.set, 12))).strip()


def _name(axes: Axes, text: str) -> None:
    axes.text(0.02, 0.97, text, transform=axes.transAxes, va="top", fontsize=7, fontweight="bold",
              bbox=_GROUND)  # fmt: skip


def _draw_consequent(
    axes: Axes, inference: Inference, o: int, fired: FiredRule, values: Sequence[float]
) -> None:
    """Draw the consequent of one rule for one output."""
    variable = inference.system.outputs[o]
    term = next((t for t in fired.rule.consequents if t.variable == variable.name), None)
    if term is None:
        _name(axes, "—")
        return
    _name(axes, _term_text(term))
    named = next(each for each in variable.sets if each.name == term.set)
    if isinstance(named, LinearFunction):
        _draw_stem(axes, _value_of(named, values), fired)
        axes.set_xlim(*_span(variable, inference, values))
        return
    at = sample_points(variable)
    assert isinstance(named, FuzzySet)
    (low,), (high,) = membership_bounds([named], at, widest_slice(inference))
    axes.plot(at, 1.0 - low if term.hedges else high, color=MUTED, lw=0.7)
    cut = implied_consequent(inference, o, fired, at)
    if cut is not None:
        _draw_area(axes, (at, cut[0]), (at, cut[1]), uncertain=inference.system.type > 1)
    axes.set_xlim(variable.low, variable.high)


def _draw_area(
    axes: Axes, lower: tuple[Array, Array], upper: tuple[Array, Array], *, uncertain: bool
) -> None:
    axes.fill_between(*upper, color=_OUTPUT, alpha=0.3, lw=0.0)
    axes.plot(*upper, color=_OUTPUT, lw=1.0)
    if uncertain:
        axes.fill_between(*lower, color=_OUTPUT, alpha=0.45, lw=0.0)
        axes.plot(*lower, color=_OUTPUT, lw=0.7, ls=(0, (3, 1.5)))


def _draw_stem(axes: Axes, value: float, fired: FiredRule) -> None:
    axes.plot([value, value], [0.0, fired.upper], color=_OUTPUT, lw=1.4)
    axes.plot([value, value], [fired.lower, fired.upper], "o", color=_OUTPUT, ms=3.0)


def _value_of(function: LinearFunction, values: Sequence[float]) -> float:
    return function.constant + sum(
        c * x for c, x in zip(function.coefficients, values, strict=False)
    )


def _span(
    variable: OutputVariable, inference: Inference, values: Sequence[float]
) -> tuple[float, float]:
    """Return the range of a Sugeno output, extended to the values of its functions."""
    functions = [each for each in variable.sets if isinstance(each, LinearFunction)]
    logs = [_value_of(each, values) for each in functions]
    low, high = min([variable.low, *logs]), max([variable.high, *logs])
    return low - 0.04 * (high - low), high + 0.04 * (high - low)


def _draw_results(
    panels: Sequence[Axes], inference: Inference, x: Sequence[float], values: Sequence[float]
) -> None:
    """Draw the aggregated output of each output variable, and its value."""
    system = inference.system
    value, minimum, greatest = inference.batch(np.array([x]))[:, 0]
    aggregated = () if system.is_sugeno else aggregated_outputs(inference, *x)
    fired = inference.fired_rules(*x)
    for o, axes in enumerate(panels):
        variable = system.outputs[o]
        if system.is_sugeno:
            for each in fired:
                for term in each.rule.consequents:
                    function = next((s for s in variable.sets if s.name == term.set), None)
                    if term.variable == variable.name and isinstance(function, LinearFunction):
                        _draw_stem(axes, _value_of(function, values), each)
            axes.set_xlim(*_span(variable, inference, values))
        else:
            lower, upper = aggregated[o]
            _draw_area(axes, (lower[0], lower[1]), (upper[0], upper[1]), uncertain=system.type > 1)
            axes.set_xlim(variable.low, variable.high)
        if system.type > 1:
            axes.axvspan(minimum[o], greatest[o], color=_VALUE, alpha=0.18, lw=0.0)
        axes.axvline(value[o], color=_VALUE, lw=1.3)
        text = f"{value[o]:.5g}"
        if system.type > 1:
            text += f"\n[{minimum[o]:.4g}, {greatest[o]:.4g}]"
        axes.set_xlabel(text, color=_VALUE, fontsize=7.5, fontweight="bold")


def _set_axes(panels: Array, inputs: int) -> None:
    """Set the ticks and limits of all panels."""
    rows = len(panels)
    for row in range(rows):
        for k, axes in enumerate(panels[row]):
            # the names stand above the curves, whose peaks are at 1
            axes.set_ylim(0.0, 1.45 if row < rows - 1 else max(1.08, axes.get_ylim()[1]))
            axes.set_yticks([])
            axes.grid(visible=False)
            axes.tick_params(labelsize=7, length=2.5)
            axes.locator_params(axis="x", nbins=3)
            last = row == (rows - 2 if k < inputs else rows - 1)
            if not last:
                axes.tick_params(labelbottom=False)
