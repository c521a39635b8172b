"""The fuzzylite language (FLL), of fuzzylite 5 to 8."""

from __future__ import annotations

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.fll_reader import system_of
from omnidrive.fuzzy.files.fll_terms import FUNCTIONS, term_text
from omnidrive.fuzzy.files.fll_words import (
    AGGREGATIONS,
    CONJUNCTIONS,
    DEFUZZIFIERS,
    DISJUNCTIONS,
    IMPLICATIONS,
)
from omnidrive.fuzzy.files.writable import (
    check_conclusions,
    check_identifiers,
    check_type_1,
    real,
    word,
)
from omnidrive.fuzzy.rule_text import RESERVED, rule_text
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import OutputVariable, Variable

RESOLUTION = 1000
"""Of the integrals, as written: fuzzylite's own default differs from release to release."""


def read_fll(text: str) -> FuzzySystem:
    """System that a text in the fuzzylite language describes.

    A default of nan is read as none; the resolution of a defuzzifier and, of an input, whether it
    is locked in its range are left to whoever evaluates the system. Several rule blocks are read
    as one if their operators are the same.

    Raises:
        InvalidFuzzyFile: The text is malformed, or says what a :class:`FuzzySystem` cannot.
    """
    return system_of(text)


def write_fll(system: FuzzySystem) -> str:
    """Text of a system in the fuzzylite language, as fuzzylite 6 to 8 read it.

    Inputs are locked in their ranges, as an input out of range is clamped here. The aggregation of
    a Sugeno output, which has no effect, is written only if it is ``sum``.

    Raises:
        InvalidInput: The language cannot say it.
    """
    check_type_1(system, "FLL")
    check_conclusions(system, "FLL")
    check_identifiers(system, "FLL", RESERVED, FUNCTIONS)
    name = system.name
    if "#" in name or "\n" in name or name != name.strip():
        raise InvalidInput(f"FLL cannot name a system {name[:40]!r}: it must be one line without #")
    lines = [f"Engine: {name}"]
    for variable in system.inputs:
        lines += [f"InputVariable: {variable.name}", *_shared(variable, True), *_sets(variable)]
    for output in system.outputs:
        lines += [f"OutputVariable: {output.name}", *_shared(output, False)]
        lines += [*_defuzzified(output), *_sets(output)]
    lines += [
        "RuleBlock:",
        "  enabled: true",
        f"  conjunction: {word('conjunction', system.conjunction, CONJUNCTIONS, 'FLL')}",
        f"  disjunction: {word('disjunction', system.disjunction, DISJUNCTIONS, 'FLL')}",
        f"  implication: {word('implication', system.implication, IMPLICATIONS, 'FLL')}",
        "  activation: General",
    ]
    lines += [f"  rule: {rule_text(rule)}" for rule in system.rules]
    return "\n".join(lines) + "\n"


def _shared(variable: Variable, locked: bool) -> list[str]:
    return [
        "  enabled: true",
        f"  range: {real(variable.low)} {real(variable.high)}",
        f"  lock-range: {str(locked).lower()}",
    ]


def _sets(variable: Variable) -> list[str]:
    return [f"  term: {each.name} {term_text(each)}" for each in variable.sets]


def _defuzzified(output: OutputVariable) -> list[str]:
    words = {str(k): v for k, v in DEFUZZIFIERS.items()}
    defuzzifier = word("defuzzifier", str(output.defuzzifier), words, "FLL")
    aggregation = word("aggregation", output.aggregation, AGGREGATIONS, "FLL")
    kind = "TakagiSugeno" if output.is_sugeno else str(RESOLUTION)
    return [
        f"  aggregation: {aggregation}",
        f"  defuzzifier: {defuzzifier} {kind}",
        f"  default: {'nan' if output.default is None else real(output.default)}",
        "  lock-previous: false",
    ]
