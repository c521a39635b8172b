"""Text and tables that describe a fuzzy system, for the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from omnidrive.errors import InvalidInput
from omnidrive.evaluation import Table
from omnidrive.fuzzy import (
    And,
    Footprint,
    FuzzySet,
    FuzzySystem,
    Inference,
    Is,
    LinearFunction,
    OutputVariable,
    Rule,
    rule_text,
)

# maximum numbers shown: sets of a variable, rules, rules that fire, and rows or columns of a table
_SETS, _RULES, _FIRED, _COLUMNS = 60, 60, 20, 20
_CELL = 40  # maximum characters of a table cell
_WIDTH = 300  # maximum characters of a rule


def summary_lines(system: FuzzySystem) -> list[str]:
    """Return lines with the name, kind, type, sizes and operators of a system."""
    kind = "Sugeno" if system.is_sugeno else "Mamdani"
    names = {1: "type 1", 2: "interval type 2", 3: "interval type 3"}
    counts = ", ".join(
        _counted(len(some), what)
        for some, what in (
            (system.inputs, "input"),
            (system.outputs, "output"),
            (system.rules, "rule"),
        )
    )
    operators = [f"and = {system.conjunction}", f"or = {system.disjunction}"]
    if not system.is_sugeno:
        operators.append(f"implication = {system.implication}")
    if system.type > 1:
        operators.append(f"type reduction = {system.algorithm}")
    return [f"{system.name}: {kind}, {names[system.type]}; {counts}", ", ".join(operators)]


def variable_lines(system: FuzzySystem) -> list[str]:
    """Return lines with each variable, its range, and its sets with parameters and footprints."""
    lines: list[str] = []
    for variable in system.variables:
        span = f"[{variable.low:g}, {variable.high:g}]"
        if isinstance(variable, OutputVariable):
            operators = [] if variable.is_sugeno else [f"aggregation = {variable.aggregation}"]
            operators.append(f"defuzzifier = {variable.defuzzifier}")
            if variable.default is not None:
                operators.append(f"default = {variable.default:g}")
            lines += ["", f"output {variable.name} in {span}, {', '.join(operators)}"]
        else:
            lines += ["", f"input {variable.name} in {span}"]
        width = min(max((len(each.name) for each in variable.sets), default=0), 20)
        lines += [
            f"  {each.name:<{width}}  {_description(each, system)}"
            for each in variable.sets[:_SETS]
        ]
        lines += filter(None, [_more(len(variable.sets), _SETS, "set")])
    return lines


def rules_table(system: FuzzySystem) -> Table | None:
    """Return the rules as a table with the sets of one input down and of the other across.

    None: there are not two inputs; the rules are not exactly one for each pair of their sets, with
    "and", without hedges of the inputs and of weight 1; or the table is too large.
    """
    if len(system.inputs) != 2 or max(len(v.sets) for v in system.inputs) > _COLUMNS:
        return None
    down, across = system.inputs
    cells: dict[tuple[str, str], str] = {}
    for rule in system.rules:
        pair = _pair(rule, down.name, across.name)
        if pair is None or pair in cells or rule.weight != 1.0:
            return None
        cells[pair] = "/".join(_consequent_text(rule, output.name) for output in system.outputs)
    if len(cells) != len(down.sets) * len(across.sets) or max(map(len, cells.values())) > _CELL:
        return None
    rows = tuple(
        (row.name, *(cells[row.name, column.name] for column in across.sets)) for row in down.sets
    )
    outputs = "/".join(output.name for output in system.outputs)
    return Table(
        f"Rules: {outputs}, for each {down.name} (down) and {across.name} (across)",
        (down.name, *(each.name for each in across.sets)),
        rows,
    )


def rule_lines(system: FuzzySystem) -> list[str]:
    """Return the rules as text with their numbers, and the number of rules not shown."""
    width = len(str(len(system.rules)))
    lines = [
        f"{number:>{width}}  {shortened_rule(rule)}"
        for number, rule in enumerate(system.rules[:_RULES], 1)
    ]
    return [*lines, *filter(None, [_more(len(system.rules), _RULES, "rule")])]


def fired_lines(inference: Inference, inputs: Sequence[float]) -> list[str]:
    """Return lines with the rules that fire, strongest first."""
    fired = inference.fired_rules(*inputs)
    if not fired:
        return ["No rule fires."]
    strengths = [
        f"{each.upper:.4f}"
        if inference.system.type == 1
        else f"{each.lower:.4f} to {each.upper:.4f}"
        for each in fired[:_FIRED]
    ]
    width = max(len(str(each.number)) for each in fired)
    lines = [
        f"{each.number:>{width}}  {strength}  {shortened_rule(each.rule)}"
        for each, strength in zip(fired, strengths, strict=False)
    ]
    more = _more(len(fired), _FIRED, "rule")
    return [
        "Rules that fire, strongest first, with their firing strengths",
        *lines,
        *filter(None, [more]),
    ]


def outputs_table(inference: Inference, inputs: Sequence[float]) -> Table:
    """Return a table of the outputs; for type 2 or 3 also with their type-reduced intervals."""
    system = inference.system
    values = inference(dict(zip((v.name for v in system.inputs), inputs, strict=True)))
    minimum, greatest = inference.interval(*inputs)
    has_interval = system.type > 1
    rows = tuple(
        (
            name[:_CELL],
            repr(value),
            *[repr(float(end[o])) for end in (minimum, greatest)] * has_interval,
        )
        for o, (name, value) in enumerate(values.items())
    )
    headings = ("output", "value", *("least", "greatest") * has_interval)
    return Table("Outputs", headings, rows)


def evaluation_lines(inference: Inference) -> list[str]:
    """Return a line on how the values of Mamdani outputs are calculated."""
    options = inference.options
    if inference.system.is_sugeno:
        return []
    if options.reduction == "cos":
        return ["centre of sets"]
    if options.centroid == "exact":
        return ["closed form; --centroid matlab: of 101 samples, as in Matlab"]
    return [f"of {options.samples} samples, as in Matlab"]


def shortened_rule(rule: Rule) -> str:
    """Return the text of a rule, truncated if it is long."""
    try:
        text = rule_text(rule)
    except InvalidInput:
        return "(rule too long to show)"
    return text if len(text) <= _WIDTH else text[: _WIDTH - 3] + "..."


def _pair(rule: Rule, down: str, across: str) -> tuple[str, str] | None:
    """Return the set of the input ``down`` and that of ``across`` that a rule combines by "and".

    None: its antecedent has another form, or hedges.
    """
    parts = rule.antecedent.parts if isinstance(rule.antecedent, And) else ()
    sets = {part.variable: part.set for part in parts if isinstance(part, Is) and not part.hedges}
    if len(parts) != 2 or set(sets) != {down, across}:
        return None
    return sets[down], sets[across]


def _consequent_text(rule: Rule, output: str) -> str:
    """Return the hedges and the set of a rule's consequent; a dash: none for this output."""
    found = next((each for each in rule.consequents if each.variable == output), None)
    return " ".join((*found.hedges, found.set)) if found else "-"


def _linear(function: LinearFunction, system: FuzzySystem) -> str:
    """Return a linear function of the inputs as a sum, constant first, truncated if it is long."""
    parts = [f"{function.constant:g}"]
    named = zip(function.coefficients, system.inputs, strict=False)
    parts += [f"{c:g} {variable.name}" for c, variable in named]
    shown = " + ".join(parts[:8]) + (" + ..." if len(parts) > 8 else "")
    return shown.replace("+ -", "- ")


def _description(each: FuzzySet | LinearFunction, system: FuzzySystem) -> str:
    """Return the parameters of a set, its footprint and secondary membership; or the function."""
    if isinstance(each, LinearFunction):
        return _linear(each, system)
    text = str(each.upper)
    if isinstance(each.lower, Footprint):
        left, right = each.lower.lags
        lags = f"{left:g}" if left == right else f"{left:g} left, {right:g} right"
        text += f", lower: scale {each.lower.scale:g}, lag {lags}"
    elif each.lower is not None:
        text += f", lower: {each.lower}"
    if each.secondary is not None:
        spread, scale, lag = each.secondary.spread, each.secondary.scale, each.secondary.lag
        text += f", secondary: spread {spread:g}, scale {scale:g}, lag {lag:g}"
    return text


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _more(count: int, shown: int, what: str) -> str:
    return f"... and {_counted(count - shown, f'more {what}')}" if count > shown else ""
