"""Syntax tree of a text in the fuzzy markup language."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.files.position import Position
from omnidrive.files.xml_elements import Element, read_xml
from omnidrive.fuzzy.position import malformed, parse_number
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES
from omnidrive.fuzzy.variables import MAX_SETS

VARIABLES = ("fuzzyVariable", "tskVariable")
RULE_BASES = ("mamdaniRuleBase", "tskRuleBase", "ruleBase")


class FuzzyTermEntry(NamedTuple):
    """Element ``fuzzyTerm``."""

    name: str
    position: Position
    is_complement: bool
    shape: Element


class TskTermEntry(NamedTuple):
    """Element ``tskTerm``."""

    name: str
    position: Position
    order: str
    values: tuple[float, ...]
    """The constant, then the coefficients."""


class VariableEntry(NamedTuple):
    """Element ``fuzzyVariable`` or ``tskVariable``."""

    name: str
    element: Element
    terms: tuple[FuzzyTermEntry, ...]
    """Of a fuzzyVariable."""
    functions: tuple[TskTermEntry, ...]
    """Of a tskVariable."""


class ClauseEntry(NamedTuple):
    """Element ``clause`` or ``tskClause``."""

    element: Element
    variable: str
    term: str


class RuleEntry(NamedTuple):
    """Element ``rule`` or ``tskRule``."""

    element: Element
    antecedent: tuple[ClauseEntry, ...]
    consequents: tuple[ClauseEntry, ...]


class RuleBaseEntry(NamedTuple):
    """Element ``mamdaniRuleBase``, ``tskRuleBase`` or ``ruleBase``."""

    element: Element
    rules: tuple[RuleEntry, ...]


class FmlFile(NamedTuple):
    """Element ``fuzzySystem``."""

    name: str
    variables: tuple[VariableEntry, ...]
    rule_bases: tuple[RuleBaseEntry, ...]


def parse(text: str) -> FmlFile:
    """Parse a text in the fuzzy markup language.

    Raises:
        InvalidFuzzyFile: The text is not XML, an element is missing or not supported, or there are
            too many.
    """
    root = read_xml(text, malformed)
    if root.tag != "fuzzySystem":
        raise malformed(root.position, f"expected fuzzySystem, got {root.tag[:40]!r}")
    variables = _variables(root.one("knowledgeBase"))
    bases: list[RuleBaseEntry] = []
    count = 0
    for each in root.children:
        if each.tag != "knowledgeBase":
            bases.append(_rule_base(each, MAX_RULES - count))
            count += len(bases[-1].rules)
    return FmlFile(root.attributes.get("name", ""), variables, tuple(bases))


def _variables(base: Element) -> tuple[VariableEntry, ...]:
    if len(base.children) > 2 * MAX_VARIABLES:
        raise malformed(base.children[2 * MAX_VARIABLES].position, "too many variables")
    found = []
    for each in base.children:
        if each.tag not in VARIABLES:
            supported = " and ".join(VARIABLES)
            raise malformed(each.position, f"{each.tag[:40]!r} is not supported, only {supported}")
        name = each.get("name")
        if each.tag == "fuzzyVariable":
            terms = tuple(_fuzzy_term(term) for term in _children(each, "fuzzyTerm"))
            found.append(VariableEntry(name, each, terms, ()))
        else:
            functions = tuple(_tsk_term(term) for term in _children(each, "tskTerm"))
            found.append(VariableEntry(name, each, (), functions))
    return tuple(found)


def _children(element: Element, tag: str) -> list[Element]:
    for each in element.children:
        if each.tag != tag:
            raise malformed(each.position, f"{element.tag}: expected {tag}, got {each.tag[:40]!r}")
    if len(element.children) > MAX_SETS:
        raise malformed(element.children[MAX_SETS].position, f"more than {MAX_SETS} terms")
    return element.children


def _fuzzy_term(term: Element) -> FuzzyTermEntry:
    name = term.get("name")
    complement = term.attributes.get("complement", "false").lower()
    if complement not in {"true", "false"}:
        raise malformed(term.position, f"complement: expected true or false, got {complement!r}")
    if len(term.children) != 1:
        raise malformed(term.position, f"fuzzyTerm: expected one shape, got {len(term.children)}")
    return FuzzyTermEntry(name, term.position, complement == "true", term.children[0])


def _tsk_term(term: Element) -> TskTermEntry:
    values = tuple(parse_number(each.text.strip(), each.position) for each in term.all("tskValue"))
    order = term.attributes.get("order", "0").strip()
    return TskTermEntry(term.get("name"), term.position, order, values)


def _rule_base(base: Element, limit: int) -> RuleBaseEntry:
    if base.tag not in RULE_BASES:
        supported = ", ".join(RULE_BASES)
        raise malformed(base.position, f"{base.tag[:40]!r} is not supported, only {supported}")
    rules: list[RuleEntry] = []
    for rule in base.children:
        if rule.tag not in {"rule", "tskRule"}:
            raise malformed(rule.position, f"expected a rule or tskRule, got {rule.tag[:40]!r}")
        if len(rules) >= limit:
            raise malformed(rule.position, f"more than {MAX_RULES} rules")
        rules.append(_rule(rule))
    return RuleBaseEntry(base, tuple(rules))


def _rule(rule: Element) -> RuleEntry:
    antecedent = tuple(_clause(each) for each in rule.one("antecedent").children)
    consequent = rule.one("consequent", "tskConsequent")
    for each in consequent.all("else", "tskElse"):
        raise malformed(each.position, "an else is not supported; write another rule")
    then = consequent.one("then", "tskThen")
    return RuleEntry(rule, antecedent, tuple(_clause(each) for each in then.children))


def _clause(clause: Element) -> ClauseEntry:
    if clause.tag not in {"clause", "tskClause"}:
        raise malformed(clause.position, f"expected a clause, got {clause.tag[:40]!r}")
    variable = clause.one("variable").text.strip()
    return ClauseEntry(clause, variable, clause.one("term").text.strip())
