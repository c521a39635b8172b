"""Fuzzy systems from the parts that a file declares, with errors that name positions."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from omnidrive.errors import InvalidFuzzyFile, InvalidInput
from omnidrive.files.position import Position
from omnidrive.fuzzy.checks import MAX_NUMBER
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.position import malformed
from omnidrive.fuzzy.rules import And, Antecedent, Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, InputVariable, LinearFunction, OutputVariable


class LocatedRule(NamedTuple):
    """A rule and its position in the file."""

    rule: Rule
    position: Position


@contextmanager
def locate_errors(position: Position | None) -> Iterator[None]:
    """Prepend a position to the message of an :class:`~omnidrive.errors.InvalidInput`."""
    try:
        yield
    except InvalidFuzzyFile:
        raise
    except InvalidInput as error:
        raise malformed(position, str(error)) from None


def assemble_system(  # noqa: PLR0917
    name: str,
    inputs: Sequence[InputVariable],
    outputs: Sequence[OutputVariable],
    rules: Sequence[LocatedRule],
    conjunction: str = "min",
    disjunction: str = "max",
    implication: str = "min",
) -> FuzzySystem:
    """Return the system of these parts.

    Raises:
        InvalidFuzzyFile: The parts are inconsistent; the message names the position of the rule
            that causes the error, if a rule does.
    """
    try:
        return FuzzySystem(
            name,
            tuple(inputs),
            tuple(outputs),
            tuple(each.rule for each in rules),
            conjunction,
            disjunction,
            implication,
        )
    except InvalidInput as error:
        culprit = re.match(r"rule (\d+)\b", str(error))
        position = rules[int(culprit[1]) - 1].position if culprit else None
        raise malformed(position, str(error)) from None


def connectives_in(rules: Sequence[LocatedRule] | Sequence[Rule]) -> frozenset[type[And | Or]]:
    """Return which of And and Or the antecedents of the rules contain."""
    found: set[type[And | Or]] = set()
    for each in rules:
        found |= _connectives((each.rule if isinstance(each, LocatedRule) else each).antecedent)
    return frozenset(found)


def _connectives(antecedent: Antecedent) -> frozenset[type[And | Or]]:
    if isinstance(antecedent, Is):
        return frozenset()
    nested = frozenset[type[And | Or]]().union(*map(_connectives, antecedent.parts))
    return nested | {type(antecedent)} if len(antecedent.parts) > 1 else nested


def repeated_consequent(output: str, rules: Sequence[LocatedRule]) -> LocatedRule | None:
    """Return the first rule with the same consequent for an output as a rule before it, or None.

    A weighted average adds the strengths of all rules. If a file aggregates the strengths of the
    rules with one consequent otherwise, the result is the same only if no consequent is repeated.
    """
    seen: Counter[str] = Counter()
    for each in rules:
        for proposition in each.rule.consequents:
            if proposition.variable == output:
                seen[proposition.set] += 1
                if seen[proposition.set] > 1:
                    return each
    return None


def hedged_consequent(rule: Rule) -> str | None:
    """Return the text of the first consequent with a hedge, or None.

    In this package and in Matlab, the consequent "y is not A" is the complement of A. In fuzzylite,
    a hedge changes the strength of the rule instead, and IEC 61131-7 has no hedges there.
    """
    for proposition in rule.consequents:
        if proposition.hedges:
            hedged = " ".join((*proposition.hedges, proposition.set)).rstrip()
            return f"{proposition.variable} is {hedged}"
    return None


def stays_in_range(output: OutputVariable) -> bool:
    """Return whether an output cannot leave its range, so that clipping has no effect."""
    if output.default is not None and not output.low <= output.default <= output.high:
        return False
    if not output.is_sugeno:
        return True
    return output.defuzzifier == "wtaver" and all(
        isinstance(each, LinearFunction)
        and not each.coefficients
        and output.low <= each.constant <= output.high
        for each in output.sets
    )


def values_of(
    functions: Sequence[LinearFunction], inputs: Sequence[InputVariable]
) -> tuple[float, float]:
    """Return the least and greatest value of linear functions over the ranges of the inputs.

    A single value is extended by 0.5 on both sides.
    """
    ends = []
    for each in functions:
        low = high = each.constant
        for slope, variable in zip(each.coefficients, inputs, strict=False):
            low += min(slope * variable.low, slope * variable.high)
            high += max(slope * variable.low, slope * variable.high)
        ends += [max(low, -MAX_NUMBER), min(high, MAX_NUMBER)]
    if not ends:
        return 0.0, 1.0
    low, high = min(ends), max(ends)
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def singleton(name: str, point: float) -> FuzzySet:
    """Return the fuzzy singleton at a point."""
    return FuzzySet(name, Membership("trimf", (point,) * 3))


def as_singletons(output: OutputVariable, aggregation: str) -> OutputVariable | None:
    """Return an output of constants as one of fuzzy singletons; None for other outputs.

    The weighted average of constants is the centroid of their singletons, whose degrees at one
    point any operator can aggregate.
    """
    constants = [
        each
        for each in output.sets
        if isinstance(each, LinearFunction) and not any(each.coefficients)
    ]
    if len(constants) < len(output.sets) or output.defuzzifier != "wtaver":
        return None
    points = [each.constant for each in constants]
    return OutputVariable(
        output.name,
        min(output.low, *points),
        max(output.high, *points),
        tuple(singleton(each.name, each.constant) for each in constants),
        aggregation,
        "centroid",
        output.fallback if output.default is None else output.default,
    )


def of_one_kind(
    outputs: Sequence[OutputVariable], aggregations: Mapping[str, str], differing: Collection[str]
) -> list[OutputVariable]:
    """Return outputs that are all made of fuzzy sets, if they can be and must be.

    They must be if some are and others are not, or if a weighted average of ``differing`` outputs
    does not aggregate degrees by their sum. They can be if all functions are constants.

    Args:
        outputs: The outputs.
        aggregations: Operator that aggregates the degrees at one point, by the name of an output;
            others are aggregated by their sum.
        differing: Names of the outputs to which a weighted average does not apply.
    """
    if not differing and len({each.is_sugeno for each in outputs}) == 1:
        return list(outputs)
    found = [
        as_singletons(each, aggregations.get(each.name, "sum")) if each.is_sugeno else each
        for each in outputs
    ]
    singletons = [each for each in found if each is not None]
    return singletons if len(singletons) == len(outputs) else list(outputs)
