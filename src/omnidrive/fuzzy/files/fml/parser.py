"""Elements of a text in the fuzzy markup language."""

from __future__ import annotations

from omnidrive.files.xml_elements import Element, read_xml
from omnidrive.fuzzy.position import malformed
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES
from omnidrive.fuzzy.variables import MAX_SETS

VARIABLES = {"fuzzyVariable": "fuzzyTerm", "tskVariable": "tskTerm"}
"""Elements of a knowledge base, and the elements in them."""

RULE_BASES = ("mamdaniRuleBase", "tskRuleBase", "ruleBase")


def parse(text: str) -> Element:
    """Return the element ``fuzzySystem``, whose variables, terms, rules and clauses are supported.

    Raises:
        InvalidFuzzyFile: The text is not XML, an element is missing or not supported, or there are
            too many.
    """
    root = read_xml(text, malformed)
    if root.tag != "fuzzySystem":
        raise malformed(root.position, f"expected fuzzySystem, got {root.tag[:40]!r}")
    _check_variables(root.one("knowledgeBase"))
    rules = [rule for base in rule_bases(root) for rule in _rules(base)]
    if len(rules) > MAX_RULES:
        raise malformed(rules[MAX_RULES].position, f"more than {MAX_RULES} rules")
    for each in rules:
        _check_rule(each)
    return root


def rule_bases(root: Element) -> list[Element]:
    """Return the rule bases of a ``fuzzySystem``."""
    return [each for each in root.children if each.tag != "knowledgeBase"]


def antecedent(rule: Element) -> list[Element]:
    """Return the clauses of a rule's antecedent."""
    return rule.one("antecedent").children


def consequents(rule: Element) -> list[Element]:
    """Return the clauses of a rule's consequent."""
    return rule.one("consequent", "tskConsequent").one("then", "tskThen").children


def _check_variables(base: Element) -> None:
    if len(base.children) > 2 * MAX_VARIABLES:
        raise malformed(base.children[2 * MAX_VARIABLES].position, "too many variables")
    for each in base.children:
        if each.tag not in VARIABLES:
            supported = " and ".join(VARIABLES)
            raise malformed(each.position, f"{each.tag[:40]!r} is not supported, only {supported}")
        expected = VARIABLES[each.tag]
        for term in each.children:
            if term.tag != expected:
                raise malformed(
                    term.position, f"{each.tag}: expected {expected}, got {term.tag[:40]!r}"
                )
        if len(each.children) > MAX_SETS:
            raise malformed(each.children[MAX_SETS].position, f"more than {MAX_SETS} terms")


def _rules(base: Element) -> list[Element]:
    if base.tag not in RULE_BASES:
        supported = ", ".join(RULE_BASES)
        raise malformed(base.position, f"{base.tag[:40]!r} is not supported, only {supported}")
    for rule in base.children:
        if rule.tag not in {"rule", "tskRule"}:
            raise malformed(rule.position, f"expected a rule or tskRule, got {rule.tag[:40]!r}")
    return base.children


def _check_rule(rule: Element) -> None:
    for each in rule.one("consequent", "tskConsequent").all("else", "tskElse"):
        raise malformed(each.position, "an else is not supported; write another rule")
    for each in (*antecedent(rule), *consequents(rule)):
        if each.tag not in {"clause", "tskClause"}:
            raise malformed(each.position, f"expected a clause, got {each.tag[:40]!r}")
