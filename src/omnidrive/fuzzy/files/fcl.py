"""The fuzzy control language (FCL) of IEC 61131-7, as jFuzzyLogic and fuzzylite have it."""

from __future__ import annotations

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import all_joins
from omnidrive.fuzzy.files.fcl_reader import FclReader
from omnidrive.fuzzy.files.fcl_rules import iec_rule
from omnidrive.fuzzy.files.fcl_terms import points_text, term_text
from omnidrive.fuzzy.files.fcl_words import ACTIVATIONS, PARTNERS, RESERVED, WORDS, Dialect, Words
from omnidrive.fuzzy.files.fll_terms import FUNCTIONS
from omnidrive.fuzzy.files.fll_terms import term_text as fll_term_text
from omnidrive.fuzzy.files.polyline import simplest
from omnidrive.fuzzy.files.writable import (
    check_conclusions,
    check_identifier,
    check_identifiers,
    check_type_1,
    real,
    word,
)
from omnidrive.fuzzy.rule_text import rule_text
from omnidrive.fuzzy.rules import Or
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, InputVariable, LinearFunction, OutputVariable

LANGUAGE: dict[Dialect, str] = {"iec": "IEC 61131-7", "fuzzylite": "fuzzylite's FCL"}


def read_fcl(text: str) -> FuzzySystem:
    """System that a text in the fuzzy control language describes.

    Both dialects are read, and keywords in any case. Points that draw a triangle, a trapezoid or a
    ramp are read as one. Where the dialects would understand a text differently it is refused. A
    missing range is what jFuzzyLogic takes it to be: where the sets are.

    Raises:
        InvalidFuzzyFile: The text is malformed, or says what a :class:`FuzzySystem` cannot.
    """
    return FclReader(text).system()


def write_fcl(system: FuzzySystem, dialect: Dialect = "iec") -> str:
    """Text of a system in the fuzzy control language.

    No text can be read by both jFuzzyLogic and fuzzylite: each refuses where the other has its
    ranges and accumulation. The aggregation of a Sugeno output, which has no effect, is written
    only if it is ``sum``.

    Args:
        system: What is written.
        dialect: ``iec``: IEC 61131-7 with jFuzzyLogic's additions; or ``fuzzylite``, which has more
            shapes, operators and hedges.

    Raises:
        InvalidInput: The dialect cannot say it.
    """
    language = LANGUAGE[dialect]
    check_type_1(system, language)
    check_conclusions(system, language)
    check_identifiers(system, language, RESERVED, () if dialect == "iec" else FUNCTIONS)
    if system.name and dialect == "iec":
        check_identifier(system.name, language, RESERVED)
    elif system.name:
        _check_line(system.name, language)
    lines = [f"FUNCTION_BLOCK {system.name}".rstrip(), ""]
    lines += _declared(system, dialect)
    for variable in system.inputs:
        lines += ["", f"FUZZIFY {variable.name}"]
        if dialect == "fuzzylite":
            lines.append(f"  RANGE := ({_range(variable)});")
        lines += [*_terms(variable, dialect), "END_FUZZIFY"]
    for output in system.outputs:
        lines += ["", f"DEFUZZIFY {output.name}", *_output(output, dialect), "END_DEFUZZIFY"]
    return "\n".join((*lines, "", *_rule_block(system, dialect), "", "END_FUNCTION_BLOCK", ""))


def _check_line(name: str, language: str) -> None:
    words = {each.lower() for each in name.replace(";", " ").split()}
    if (
        any(mark in name for mark in ("//", "/*", "(*", "#", "%", ";"))
        or name != name.strip()
        or not name.isprintable()
        or words & RESERVED
    ):
        raise InvalidInput(
            f"{language} cannot name a system {name[:40]!r}: it must be one line without comment "
            "marks, semicolons and keywords"
        )


def _declared(system: FuzzySystem, dialect: Dialect) -> list[str]:
    lines = ["VAR_INPUT"]
    for variable in system.inputs:
        lines.append(f"  {variable.name} : REAL;")
        if dialect == "iec":
            lines.append(f"  RANGE := ({_range(variable)});")
    lines += ["END_VAR", "", "VAR_OUTPUT"]
    return [*lines, *(f"  {output.name} : REAL;" for output in system.outputs), "END_VAR"]


def _range(variable: InputVariable | OutputVariable) -> str:
    return f"{real(variable.low)} .. {real(variable.high)}"


def _terms(variable: InputVariable | OutputVariable, dialect: Dialect) -> list[str]:
    text = term_text if dialect == "iec" else _fuzzylite_term
    return [f"  TERM {each.name} := {text(each)};" for each in variable.sets]


def _fuzzylite_term(each: FuzzySet | LinearFunction) -> str:
    if isinstance(each, LinearFunction) and not each.coefficients:
        return real(each.constant)
    if isinstance(each, FuzzySet) and each.upper.shape == "pointsmf":
        p = each.upper.parameters
        if simplest(each.upper) is each.upper:
            return points_text(p[::2], p[1::2])
    return fll_term_text(each)


def _output(output: OutputVariable, dialect: Dialect) -> list[str]:
    words, language = WORDS[dialect], LANGUAGE[dialect]
    lines = [f"  RANGE := ({_range(output)});", *_terms(output, dialect)]
    lines.append(f"  METHOD : {word('method', str(output.defuzzifier), words.methods, language)};")
    if dialect == "fuzzylite" and (not output.is_sugeno or output.aggregation == "sum"):
        accu = word("aggregation", output.aggregation, words.aggregations, language)
        lines.append(f"  ACCU : {accu};")
    if output.default is not None:
        lines.append(f"  DEFAULT := {real(output.default)};")
    elif dialect == "fuzzylite":
        lines.append("  DEFAULT := nan;")
    return lines


def _rule_block(system: FuzzySystem, dialect: Dialect) -> list[str]:
    words, language = WORDS[dialect], LANGUAGE[dialect]
    conjunction = word("conjunction", system.conjunction, words.conjunctions, language)
    disjunction = word("disjunction", system.disjunction, words.disjunctions, language)
    joined = [f"  AND : {conjunction};", f"  OR : {disjunction};"]
    if dialect == "iec":
        joined = _in_order(system, joined)
    lines = ["RULEBLOCK rules", *joined, f"  ACT : {ACTIVATIONS[system.implication]};"]
    if dialect == "iec":
        lines += _accumulation(system, words, language)
    text = iec_rule if dialect == "iec" else rule_text
    lines += [f"  RULE {k} : {text(rule)}" for k, rule in enumerate(system.rules, 1)]
    return [*lines, "END_RULEBLOCK"]


def _in_order(system: FuzzySystem, joined: list[str]) -> list[str]:
    """The operators, the one that counts last: in jFuzzyLogic it replaces the other."""
    if PARTNERS[system.conjunction] == system.disjunction:
        return joined
    used = all_joins(system.rules)
    if len(used) > 1:
        raise InvalidInput(
            f"IEC 61131-7 joins the conjunction {system.conjunction!r} with the disjunction "
            f"{PARTNERS[system.conjunction]!r}, not {system.disjunction!r}; fuzzylite's dialect "
            "has both: write_fcl(system, 'fuzzylite')"
        )
    return joined if Or in used else joined[::-1]


def _accumulation(system: FuzzySystem, words: Words, language: str) -> list[str]:
    found = {output.aggregation for output in system.outputs}
    if system.is_sugeno and "sum" not in found:
        return []
    if len(found) > 1:
        raise InvalidInput(
            f"{language} has one aggregation for all outputs, not {', '.join(sorted(found))}"
        )
    return [f"  ACCU : {word('aggregation', found.pop(), words.aggregations, language)};"]
