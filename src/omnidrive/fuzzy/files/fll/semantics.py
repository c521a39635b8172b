"""Fuzzy system that a text in the fuzzylite language describes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.checks import MAX_NUMBER
from omnidrive.fuzzy.files.assembly import (
    LocatedRule,
    assemble_system,
    connectives_in,
    hedged_consequent,
    locate_errors,
    of_one_kind,
    repeated_consequent,
    stays_in_range,
)
from omnidrive.fuzzy.files.fll.lexer import Line
from omnidrive.fuzzy.files.fll.parser import Component, parse
from omnidrive.fuzzy.files.fll.term_semantics import read_term
from omnidrive.fuzzy.position import malformed, parse_number
from omnidrive.fuzzy.rule_text import parse_rule
from omnidrive.fuzzy.rules import And, Or
from omnidrive.fuzzy.system import MAX_RULES, FuzzySystem
from omnidrive.fuzzy.variables import (
    MAX_SETS,
    Defuzzifier,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
)

Name = TypeVar("Name", bound=str)

# fuzzylite's keywords by the names in this package.
CONJUNCTIONS = {
    "min": "Minimum",
    "prod": "AlgebraicProduct",
    "lukasiewicz": "BoundedDifference",
    "drastic": "DrasticProduct",
    "einstein": "EinsteinProduct",
    "hamacher": "HamacherProduct",
    "nilpotent": "NilpotentMinimum",
}
DISJUNCTIONS = {
    "max": "Maximum",
    "probor": "AlgebraicSum",
    "bsum": "BoundedSum",
    "drastic": "DrasticSum",
    "einstein": "EinsteinSum",
    "hamacher": "HamacherSum",
    "nilpotent": "NilpotentMaximum",
}
AGGREGATIONS = {**DISJUNCTIONS, "sum": "UnboundedSum"}
IMPLICATIONS = {"min": "Minimum", "prod": "AlgebraicProduct"}
DEFUZZIFIERS: dict[Defuzzifier, str] = {
    "centroid": "Centroid",
    "bisector": "Bisector",
    "mom": "MeanOfMaximum",
    "lm": "SmallestOfMaximum",
    "rm": "LargestOfMaximum",
    "wtaver": "WeightedAverage",
    "wtsum": "WeightedSum",
}
"""fuzzylite's smallest maximum is the leftmost; Matlab's is that of smallest magnitude."""


def read_fll(text: str) -> FuzzySystem:
    """Return the system that a text in the fuzzylite language describes.

    A default of nan is read as None. The resolution of a defuzzifier and the key lock-range of an
    input are ignored: they are options of :class:`~omnidrive.fuzzy.Inference`. Several rule blocks
    are merged if their operators are the same.

    Raises:
        InvalidFuzzyFile: The text is malformed, or :class:`FuzzySystem` does not support a part.
    """
    file = parse(text)
    inputs = [_input(each) for each in file.inputs]
    outputs = [_output(each, len(inputs)) for each in file.outputs]
    rules, operators = _rules(file.rule_blocks, any(each.is_sugeno for each in outputs))
    outputs = _aggregated(file.outputs, outputs, rules)
    return assemble_system(file.name, inputs, outputs, rules, *operators)


def _input(component: Component) -> InputVariable:
    component.check_enabled()
    component.is_true("lock-range")
    low, high = _range(component)
    sets = _terms(component, 0)
    with locate_errors(component.position):
        for each in sets:
            if not isinstance(each, FuzzySet):
                raise InvalidInput(f"{each.name!r}: the terms of an input must be fuzzy sets")
        fuzzy_sets = tuple(each for each in sets if isinstance(each, FuzzySet))
        return InputVariable(component.name, low, high, fuzzy_sets)


def _output(component: Component, inputs: int) -> OutputVariable:
    component.check_enabled()
    low, high = _range(component)
    sets = _terms(component, inputs)
    defuzzifier = _defuzzifier(component)
    aggregation = _choice(component, AGGREGATIONS, "aggregation", "accumulation")
    previous = component.get("lock-previous", "lock-valid")
    if component.is_true("lock-previous", "lock-valid"):
        raise malformed(
            previous.position if previous else None,
            "an output that keeps its previous value is not supported; give it a default",
        )
    default = component.get("default")
    value = None
    if default is not None and default.value.lower() != "nan":
        value = parse_number(default.value, default.value_position)
    functions = tuple(each for each in sets if isinstance(each, LinearFunction))
    fuzzy_sets = tuple(each for each in sets if isinstance(each, FuzzySet))
    name = component.name
    with locate_errors(component.position):
        if fuzzy_sets and functions:
            raise InvalidInput(f"output {name!r} mixes fuzzy sets and functions")
        if fuzzy_sets and defuzzifier in {"wtaver", "wtsum"}:
            raise InvalidInput(
                f"output {name!r}: {DEFUZZIFIERS[defuzzifier]} of fuzzy sets is not supported, "
                "only of Constant and Linear"
            )
        if fuzzy_sets and aggregation is None:
            raise InvalidInput(
                f"output {name!r} needs an aggregation, such as aggregation: Maximum"
            )
        return OutputVariable(
            name, low, high, functions or fuzzy_sets, aggregation or "max", defuzzifier, value
        )


def _terms(component: Component, inputs: int) -> list[FuzzySet | LinearFunction]:
    if len(component.listed) > MAX_SETS:
        raise malformed(component.listed[MAX_SETS].position, f"more than {MAX_SETS} terms")
    sets = []
    for line in component.listed:
        tokens = line.tokens()
        if len(tokens) < 2:
            raise malformed(line.value_position, "expected a name, a class and its parameters")
        sets.append(read_term(tokens[0].text, tokens[1], tokens[2:], inputs))
    return sets


def _range(component: Component) -> tuple[float, float]:
    line = component.get("range")
    if line is None:
        raise malformed(component.position, f"{component.name[:40]!r}: expected a range: MIN MAX")
    tokens = line.tokens()
    if len(tokens) != 2:
        raise malformed(line.value_position, f"expected two numbers, got {line.value[:40]!r}")
    low, high = (parse_number(*each) for each in tokens)
    if component.kind == "InputVariable":  # whose range is unlimited by default
        return max(low, -MAX_NUMBER), min(high, MAX_NUMBER)
    return low, high


def _defuzzifier(component: Component) -> Defuzzifier:
    line = component.get("defuzzifier")
    if line is None:
        raise malformed(component.position, f"{component.name[:40]!r}: expected a defuzzifier")
    kind, *rest = line.tokens()
    found = _name_of(line, kind.text, DEFUZZIFIERS)
    if found in {"wtaver", "wtsum"}:
        if [each.text for each in rest] not in ([], ["Automatic"], ["TakagiSugeno"]):
            raise malformed(
                rest[0].position, f"expected TakagiSugeno or Automatic, got {rest[0].text[:40]!r}"
            )
    elif len(rest) > 1 or (rest and parse_number(*rest[0]) < 1):
        raise malformed(rest[0].position, "expected a resolution, a number from 1")
    return found


def _choice(component: Component, keywords: Mapping[str, str], *keys: str) -> str | None:
    """Return this package's name of the operator that the first key present selects, or None."""
    line = component.get(*keys)
    return None if line is None else _name_of(line, line.value, keywords)


def _name_of(line: Line, found: str, keywords: Mapping[Name, str]) -> Name:
    for name, keyword in keywords.items():
        if keyword == found:
            return name
    raise malformed(
        line.value_position,
        f"{line.key}: expected one of {', '.join(keywords.values())}, got {found[:40]!r}",
    )


def _rules(
    blocks: list[Component], is_sugeno: bool
) -> tuple[list[LocatedRule], tuple[str, str, str]]:
    """Return all rules, and the names of conjunction, disjunction and implication."""
    rules: list[LocatedRule] = []
    chosen: dict[str, str] = {}
    articles = {"conjunction": "a", "disjunction": "a", "implication": "an"}
    tables = {
        "conjunction": CONJUNCTIONS,
        "disjunction": DISJUNCTIONS,
        "implication": IMPLICATIONS,
    }
    for block in blocks:
        block.check_enabled()
        keys = {key: (key,) for key in tables}
        if not _has_general_activation(block):
            keys["implication"] = ("activation",)
        found = {key: _choice(block, tables[key], *keys[key]) for key in tables}
        block_rules = _block_rules(block, MAX_RULES - len(rules))
        used = connectives_in(block_rules)
        for key, needed in (
            ("conjunction", And in used),
            ("disjunction", Or in used),
            ("implication", not is_sugeno and bool(block_rules)),
        ):
            name = found[key]
            if name is None and needed:
                raise malformed(
                    block.position,
                    f"its rules need {articles[key]} {key}: expected it in this block",
                )
            if name is not None and chosen.setdefault(key, name) != name:
                line = block.get(*keys[key])
                raise malformed(
                    line.position if line else None,
                    f"rule blocks with different {key}s are not supported",
                )
        rules += block_rules
    return rules, (
        chosen.get("conjunction", "min"),
        chosen.get("disjunction", "max"),
        chosen.get("implication", "min"),
    )


def _has_general_activation(block: Component) -> bool:
    """Check that all rules are activated; return False if fuzzylite 5's implication is meant."""
    line = block.get("activation")
    if line is None or line.value == "General":
        return True
    if line.value in CONJUNCTIONS.values() and block.get("implication") is None:
        return False
    raise malformed(
        line.value_position,
        f"activation: {line.value[:40]!r} is not supported, only General",
    )


def _block_rules(block: Component, limit: int) -> list[LocatedRule]:
    if len(block.listed) > limit:
        raise malformed(block.listed[limit].position, f"more than {MAX_RULES} rules")
    rules = []
    for line in block.listed:
        rule = parse_rule(line.value, line.value_position)
        if hedged := hedged_consequent(rule):
            raise malformed(
                line.value_position,
                f"{hedged!r}: fuzzylite applies a hedge in a consequent to the strength of the "
                "rule, which is not supported",
            )
        rules.append(LocatedRule(rule, line.value_position))
    return rules


def _aggregated(
    components: list[Component], outputs: list[OutputVariable], rules: list[LocatedRule]
) -> list[OutputVariable]:
    """Return the outputs, with constants as fuzzy singletons where their mean differs.

    Raises:
        InvalidFuzzyFile: The value of an output in fuzzylite differs from that in this package.
    """
    aggregations: dict[str, str] = {}
    differing: dict[str, tuple[Line, LocatedRule]] = {}
    for component, output in zip(components, outputs, strict=True):
        line = component.get("lock-range")
        if line is not None and component.is_true("lock-range") and not stays_in_range(output):
            raise malformed(
                line.position,
                f"output {output.name!r} may leave its range: clipping is not supported",
            )
        line, chosen = component.get("aggregation"), _choice(component, AGGREGATIONS, "aggregation")
        if line is None or chosen in {None, "sum"}:
            continue
        constants = [each.constant for each in output.sets if isinstance(each, LinearFunction)]
        if len(set(constants)) == len(constants):  # fuzzylite aggregates per term, not per point
            aggregations[output.name] = str(chosen)
        repeated = repeated_consequent(output.name, rules) if output.is_sugeno else None
        if repeated is not None:
            differing[output.name] = line, repeated
    found = of_one_kind(outputs, aggregations, differing)
    for name, (line, repeated) in differing.items():
        if found[0].is_sugeno or name not in aggregations:
            raise malformed(
                line.position,
                f"{line.value} of rules with one consequent (line {repeated.position.line}) is "
                "not supported: expected none or UnboundedSum",
            )
    return found
