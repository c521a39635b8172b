"""From the parts that a file gives to a fuzzy system, with errors that say where."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from omnidrive.errors import InvalidFuzzyFile, InvalidInput
from omnidrive.fuzzy.files.source import Position, malformed
from omnidrive.fuzzy.rules import And, Antecedent, Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import InputVariable, LinearFunction, OutputVariable


class LocatedRule(NamedTuple):
    """A rule, and where it stands."""

    rule: Rule
    position: Position


@contextmanager
def locate_errors(position: Position | None) -> Iterator[None]:
    """Say where the file says what a class of the system refuses."""
    try:
        yield
    except InvalidFuzzyFile:
        raise
    except InvalidInput as error:
        raise malformed(position, str(error)) from None


def assembled(  # noqa: PLR0917
    name: str,
    inputs: Sequence[InputVariable],
    outputs: Sequence[OutputVariable],
    rules: Sequence[LocatedRule],
    conjunction: str = "min",
    disjunction: str = "max",
    implication: str = "min",
) -> FuzzySystem:
    """The system of these parts.

    Raises:
        InvalidFuzzyFile: They do not fit; where a rule is at fault, its place is named.
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


def joins(antecedent: Antecedent) -> frozenset[type[And | Or]]:
    """Which of "and" and "or" an antecedent needs."""
    if isinstance(antecedent, Is):
        return frozenset()
    below = frozenset[type[And | Or]]().union(*map(joins, antecedent.parts))
    return below | {type(antecedent)} if len(antecedent.parts) > 1 else below


def all_joins(rules: Sequence[LocatedRule] | Sequence[Rule]) -> frozenset[type[And | Or]]:
    """Which of "and" and "or" any of several rules needs."""
    found: set[type[And | Or]] = set()
    for each in rules:
        found |= joins((each.rule if isinstance(each, LocatedRule) else each).antecedent)
    return frozenset(found)


def shared_conclusion(output: str, rules: Sequence[LocatedRule]) -> LocatedRule | None:
    """The second rule that concludes the same about an output; None: no two do.

    A weighted average adds the strengths of all rules. Where a file joins those of one consequent
    by something else, it means the same only if no consequent is shared.
    """
    seen: Counter[str] = Counter()
    for each in rules:
        for term in each.rule.consequents:
            if term.variable == output:
                seen[term.set] += 1
                if seen[term.set] > 1:
                    return each
    return None


def hedged_consequent(rule: Rule) -> str | None:
    """A consequent with a hedge, as text; None: there is none.

    Here and in Matlab "y is not A" concludes the complement of A. To fuzzylite a hedge changes the
    strength of the rule instead, and IEC 61131-7 has none.
    """
    for term in rule.consequents:
        if term.hedges:
            return f"{term.variable} is {' '.join((*term.hedges, term.set))}".rstrip()
    return None


def stays_in_range(output: OutputVariable) -> bool:
    """Whether an output cannot leave its range, so that clipping it changes nothing."""
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
