"""Text of a fuzzy system in the fuzzylite language."""

from __future__ import annotations

from math import inf

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.fll.semantics import (
    AGGREGATIONS,
    CONJUNCTIONS,
    DEFUZZIFIERS,
    DISJUNCTIONS,
    IMPLICATIONS,
)
from omnidrive.fuzzy.files.fll.term_semantics import TERMS
from omnidrive.fuzzy.files.writer_checks import (
    check_consequents,
    check_identifiers,
    check_type_1,
    keyword,
    number_text,
)
from omnidrive.fuzzy.rule_text import RESERVED, rule_text
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction, OutputVariable, Variable

RESOLUTION = 1000
"""Resolution of the integrals; it is written because fuzzylite's default varies by release."""

FUNCTIONS = frozenset(
    {
        *("abs", "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh"),
        *("ceil", "cos", "cosh", "eq", "exp", "fabs", "floor", "fmod"),
        *("ge", "gt", "le", "log", "log10", "log1p", "lt", "max"),
        *("min", "neq", "pi", "pow", "round", "sin", "sinh", "sqrt"),
        *("tan", "tanh"),
    }
)
"""Names of fuzzylite's functions, which are not valid as names in rules."""


def write_fll(system: FuzzySystem) -> str:
    """Return the text of a system in the fuzzylite language of fuzzylite 6 to 8.

    Inputs are locked in their ranges, because this package clamps inputs to their ranges. The
    aggregation of a Sugeno output, which has no effect, is written only if it is ``sum``.

    Raises:
        InvalidInput: The language does not support a part of the system.
    """
    check_type_1(system, "FLL")
    check_consequents(system, "FLL")
    check_identifiers(system, "FLL", RESERVED, FUNCTIONS)
    name = system.name
    if "#" in name or "\n" in name or name != name.strip():
        raise InvalidInput(
            f"{name[:40]!r} is not a valid name of a system in FLL: it must be one line without #"
        )
    lines = [f"Engine: {name}"]
    for variable in system.inputs:
        lines += [f"InputVariable: {variable.name}", *_range(variable, True), *_terms(variable)]
    for output in system.outputs:
        lines += [f"OutputVariable: {output.name}", *_range(output, False)]
        lines += [*_defuzzification(output), *_terms(output)]
    lines += [
        "RuleBlock:",
        "  enabled: true",
        f"  conjunction: {keyword('conjunction', system.conjunction, CONJUNCTIONS, 'FLL')}",
        f"  disjunction: {keyword('disjunction', system.disjunction, DISJUNCTIONS, 'FLL')}",
        f"  implication: {keyword('implication', system.implication, IMPLICATIONS, 'FLL')}",
        "  activation: General",
    ]
    lines += [f"  rule: {rule_text(rule)}" for rule in system.rules]
    return "\n".join(lines) + "\n"


def _range(variable: Variable, locked: bool) -> list[str]:
    return [
        "  enabled: true",
        f"  range: {number_text(variable.low)} {number_text(variable.high)}",
        f"  lock-range: {str(locked).lower()}",
    ]


def _defuzzification(output: OutputVariable) -> list[str]:
    keywords = {str(name): each for name, each in DEFUZZIFIERS.items()}
    defuzzifier = keyword("defuzzifier", str(output.defuzzifier), keywords, "FLL")
    aggregation = keyword("aggregation", output.aggregation, AGGREGATIONS, "FLL")
    kind = "TakagiSugeno" if output.is_sugeno else str(RESOLUTION)
    return [
        f"  aggregation: {aggregation}",
        f"  defuzzifier: {defuzzifier} {kind}",
        f"  default: {'nan' if output.default is None else number_text(output.default)}",
        "  lock-previous: false",
    ]


def _terms(variable: Variable) -> list[str]:
    return [f"  term: {each.name} {term_text(each)}" for each in variable.sets]


def term_text(each: FuzzySet | LinearFunction) -> str:
    """Return fuzzylite's class and parameters of a set or a function.

    Raises:
        InvalidInput: fuzzylite has no such set.
    """
    if isinstance(each, LinearFunction):
        kind = "Linear" if each.coefficients else "Constant"
        return _text(kind, (*each.coefficients, each.constant))
    shape, p = each.upper.shape, each.upper.forward.parameters
    if shape == "pointsmf":
        return _text("Discrete", p)
    if shape in {"linsmf", "linzmf"}:
        rises = shape == "linsmf"
        if p[0] == p[1]:
            return _text("Binary", (p[0], inf if rises else -inf))
        return _text("Ramp", p if rises else p[::-1])
    if shape == "cosinemf":
        return _text("Cosine", (p[1], 2.0 * p[0]))
    for kind, term in TERMS.items():
        if term.shape == shape:
            return _text(kind, tuple(p[term.order.index(k)] for k in range(len(p))))
    raise InvalidInput(f"the fuzzylite language has no {shape} (set {each.name!r})")


def _text(kind: str, parameters: tuple[float, ...]) -> str:
    return " ".join((kind, *map(number_text, parameters)))
