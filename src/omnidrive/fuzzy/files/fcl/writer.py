"""Text of a fuzzy system in the fuzzy control language."""

from __future__ import annotations

from collections.abc import Sequence

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import connectives_in
from omnidrive.fuzzy.files.fcl.lexer import (
    ACTIVATIONS,
    KEYWORDS,
    RESERVED,
    TERMS,
    Dialect,
    Keywords,
)
from omnidrive.fuzzy.files.fcl.semantics import PARTNERS
from omnidrive.fuzzy.files.fcl.term_semantics import CORNERS, is_dsigm, simplest_shape
from omnidrive.fuzzy.files.fll.writer import FUNCTIONS
from omnidrive.fuzzy.files.fll.writer import term_text as fll_term_text
from omnidrive.fuzzy.files.writer_checks import (
    check_consequents,
    check_identifier,
    check_identifiers,
    check_type_1,
    keyword,
    number_text,
)
from omnidrive.fuzzy.rule_text import normalised, rule_text
from omnidrive.fuzzy.rules import And, Antecedent, Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, InputVariable, LinearFunction, OutputVariable
from omnidrive.parameter import check_choice

LANGUAGE: dict[Dialect, str] = {"iec": "IEC 61131-7", "fuzzylite": "fuzzylite's FCL"}

_USE_FUZZYLITE = "fuzzylite's dialect does: write_fcl(system, 'fuzzylite')"


def write_fcl(system: FuzzySystem, dialect: Dialect = "iec") -> str:
    """Return the text of a system in the fuzzy control language.

    No text is valid for both jFuzzyLogic and fuzzylite, because they expect ranges and
    accumulation in different sections. The aggregation of a Sugeno output, which has no effect, is
    written only if it is ``sum``.

    Args:
        system: The system.
        dialect: ``iec``: IEC 61131-7 with the additions of jFuzzyLogic; or ``fuzzylite``, which has
            more shapes, operators and hedges.

    Raises:
        InvalidInput: The dialect is unknown, or does not support a part of the system.
    """
    check_choice("dialect", dialect, LANGUAGE)
    language = LANGUAGE[dialect]
    check_type_1(system, language)
    check_consequents(system, language)
    check_identifiers(system, language, RESERVED, () if dialect == "iec" else FUNCTIONS)
    if system.name and dialect == "iec":
        check_identifier(system.name, language, RESERVED)
    elif system.name:
        _check_line(system.name, language)
    lines = [f"FUNCTION_BLOCK {system.name}".rstrip(), ""]
    lines += _declarations(system, dialect)
    for variable in system.inputs:
        lines += ["", f"FUZZIFY {variable.name}"]
        if dialect == "fuzzylite":
            lines.append(f"  RANGE := ({_range(variable)});")
        lines += [*_terms(variable, dialect), "END_FUZZIFY"]
    inputs = [variable.name for variable in system.inputs]
    for output in system.outputs:
        text = _output(output, dialect, inputs)
        lines += ["", f"DEFUZZIFY {output.name}", *text, "END_DEFUZZIFY"]
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
            f"{name[:40]!r} is not a valid name of a system in {language}: it must be one line "
            "without comment marks, semicolons and keywords"
        )


def _declarations(system: FuzzySystem, dialect: Dialect) -> list[str]:
    lines = ["VAR_INPUT"]
    for variable in system.inputs:
        lines.append(f"  {variable.name} : REAL;")
        if dialect == "iec":
            lines.append(f"  RANGE := ({_range(variable)});")
    lines += ["END_VAR", "", "VAR_OUTPUT"]
    return [*lines, *(f"  {output.name} : REAL;" for output in system.outputs), "END_VAR"]


def _range(variable: InputVariable | OutputVariable) -> str:
    return f"{number_text(variable.low)} .. {number_text(variable.high)}"


def _terms(
    variable: InputVariable | OutputVariable, dialect: Dialect, inputs: Sequence[str] = ()
) -> list[str]:
    return [
        f"  TERM {each.name} := "
        f"{_iec_term(each, inputs) if dialect == 'iec' else _fuzzylite_term(each)};"
        for each in variable.sets
    ]


def _iec_term(each: FuzzySet | LinearFunction, inputs: Sequence[str]) -> str:
    if isinstance(each, LinearFunction):
        terms = [
            f"{number_text(value)} * {name}"
            for name, value in zip(inputs, each.coefficients, strict=False)
        ]
        if terms:
            return f"FUNCTION ({' + '.join((*terms, number_text(each.constant)))})"
        return number_text(each.constant)
    shape, p = each.upper.shape, each.upper.parameters
    if shape in CORNERS:
        return _points_text(p, CORNERS[shape])
    if shape == "pointsmf":
        return _points_text(p[::2], p[1::2])
    for word, (name, order) in TERMS.items():
        if name == shape and (shape != "dsigmf" or is_dsigm(*p)):
            return " ".join((word, *(number_text(p[order.index(k)]) for k in range(len(p)))))
    raise InvalidInput(
        f"IEC 61131-7 and jFuzzyLogic do not support this {shape} (set {each.name!r}); "
        f"{_USE_FUZZYLITE}"
    )


def _fuzzylite_term(each: FuzzySet | LinearFunction) -> str:
    if isinstance(each, LinearFunction) and not each.coefficients:
        return number_text(each.constant)
    if isinstance(each, FuzzySet) and each.upper.shape == "pointsmf":
        p = each.upper.parameters
        if simplest_shape(each.upper) is each.upper:
            return _points_text(p[::2], p[1::2])
    return fll_term_text(each)


def _points_text(x: tuple[float, ...], degrees: tuple[float, ...]) -> str:
    points = zip(x, degrees, strict=True)
    return " ".join(f"({number_text(a)}, {number_text(b)})" for a, b in points)


def _output(output: OutputVariable, dialect: Dialect, inputs: Sequence[str]) -> list[str]:
    keywords, language = KEYWORDS[dialect], LANGUAGE[dialect]
    method = keyword("method", str(output.defuzzifier), keywords.methods, language)
    lines = [
        f"  RANGE := ({_range(output)});",
        *_terms(output, dialect, inputs),
        f"  METHOD : {method};",
    ]
    if dialect == "fuzzylite" and (not output.is_sugeno or output.aggregation == "sum"):
        accu = keyword("aggregation", output.aggregation, keywords.aggregations, language)
        lines.append(f"  ACCU : {accu};")
    if output.default is not None:
        lines.append(f"  DEFAULT := {number_text(output.default)};")
    elif dialect == "fuzzylite":
        lines.append("  DEFAULT := nan;")
    return lines


def _rule_block(system: FuzzySystem, dialect: Dialect) -> list[str]:
    keywords, language = KEYWORDS[dialect], LANGUAGE[dialect]
    conjunction = keyword("conjunction", system.conjunction, keywords.conjunctions, language)
    disjunction = keyword("disjunction", system.disjunction, keywords.disjunctions, language)
    operators = [f"  AND : {conjunction};", f"  OR : {disjunction};"]
    if dialect == "iec":
        operators = _ordered(system, operators)
    lines = ["RULEBLOCK rules", *operators, f"  ACT : {ACTIVATIONS[system.implication]};"]
    if dialect == "iec":
        lines += _accumulation(system, keywords, language)
    text = _iec_rule if dialect == "iec" else rule_text
    lines += [f"  RULE {k} : {text(rule)}" for k, rule in enumerate(system.rules, 1)]
    return [*lines, "END_RULEBLOCK"]


def _ordered(system: FuzzySystem, operators: list[str]) -> list[str]:
    """Return AND and OR with the relevant one last: in jFuzzyLogic it replaces the other."""
    if PARTNERS[system.conjunction] == system.disjunction:
        return operators
    used = connectives_in(system.rules)
    if len(used) > 1:
        raise InvalidInput(
            f"IEC 61131-7 combines the conjunction {system.conjunction!r} with the disjunction "
            f"{PARTNERS[system.conjunction]!r} and does not support {system.disjunction!r}; "
            f"{_USE_FUZZYLITE}"
        )
    return operators if Or in used else operators[::-1]


def _accumulation(system: FuzzySystem, keywords: Keywords, language: str) -> list[str]:
    found = {output.aggregation for output in system.outputs}
    if system.is_sugeno and "sum" not in found:
        return []
    if len(found) > 1:
        raise InvalidInput(
            f"{language} has one aggregation for all outputs, not {', '.join(sorted(found))}"
        )
    accu = keyword("aggregation", found.pop(), keywords.aggregations, language)
    return [f"  ACCU : {accu};"]


def _iec_rule(rule: Rule) -> str:
    """Return the text of a rule that IEC 61131-7 and jFuzzyLogic interpret alike."""
    consequents = ", ".join(f"{each.variable} IS {each.set}" for each in rule.consequents)
    weight = "" if rule.weight == 1.0 else f" WITH {number_text(rule.weight)}"
    return f"IF {_antecedent(normalised(rule.antecedent), top=True)} THEN {consequents}{weight};"


def _antecedent(antecedent: Antecedent, top: bool = False) -> str:
    if isinstance(antecedent, Is):
        if antecedent.hedges not in {(), ("not",)}:
            hedged = " ".join((*antecedent.hedges, antecedent.set))
            raise InvalidInput(
                f"IEC 61131-7 does not support hedges but NOT ({antecedent.variable} is {hedged}); "
                f"{_USE_FUZZYLITE}"
            )
        return f"{antecedent.variable} IS {'NOT ' if antecedent.hedges else ''}{antecedent.set}"
    connective = " AND " if isinstance(antecedent, And) else " OR "
    text = connective.join(map(_antecedent, antecedent.parts))
    return text if top else f"({text})"
