"""Reads the fuzzy markup language (FML), IEEE 1855-2016, from its elements."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TypeVar

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import LocatedRule, assemble_system, locate_errors
from omnidrive.fuzzy.files.fml_shapes import read_shape
from omnidrive.fuzzy.files.fml_words import (
    RANGE,
    READ_ACTIVATIONS,
    READ_CONJUNCTIONS,
    READ_DEFUZZIFIERS,
    READ_DISJUNCTIONS,
    READ_MODIFIERS,
)
from omnidrive.fuzzy.files.xml_tree import Element
from omnidrive.fuzzy.position import malformed, parse_number
from omnidrive.fuzzy.rules import And, Antecedent, Hedge, Is, Or, Rule
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES, FuzzySystem
from omnidrive.fuzzy.variables import (
    MAX_SETS,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
)

VARIABLES = ("fuzzyVariable", "tskVariable")
RULE_BASES = ("mamdaniRuleBase", "tskRuleBase", "ruleBase")

Choice = TypeVar("Choice", bound=str)


class FmlReader:
    """Reads one ``fuzzySystem``; see :func:`omnidrive.fuzzy.files.fml.read_fml`."""

    def __init__(self, root: Element) -> None:
        self._root = root
        self._inputs: list[InputVariable] = []
        self._outputs: list[OutputVariable] = []
        self._complements: set[tuple[str, str]] = set()
        self._operators: dict[str, str] = {}
        self._rules: list[LocatedRule] = []

    def system(self) -> FuzzySystem:
        """The system that it describes."""
        root = self._root
        if root.tag != "fuzzySystem":
            raise malformed(root.position, f"expected fuzzySystem, got {root.tag[:40]!r}")
        self._variables(root.one("knowledgeBase"))
        bases = [self._rule_base(each) for each in root.children if each.tag != "knowledgeBase"]
        unused = {name: value for base in reversed(bases) for name, value in base.items()}
        return assemble_system(
            root.attributes.get("name", ""),
            self._inputs,
            self._outputs,
            self._rules,
            self._operators.get("andMethod", unused.get("andMethod", "min")),
            self._operators.get("orMethod", unused.get("orMethod", "max")),
            self._operators.get("activationMethod", unused.get("activationMethod", "min")),
        )

    def _variables(self, base: Element) -> None:
        if len(base.children) > 2 * MAX_VARIABLES:
            raise malformed(base.children[2 * MAX_VARIABLES].position, "too many variables")
        for each in base.children:
            if each.tag not in VARIABLES:
                raise malformed(
                    each.position,
                    f"{each.tag[:40]!r} cannot be expressed, only {' and '.join(VARIABLES)}",
                )
            if each.tag == "fuzzyVariable":
                self._fuzzy_variable(each)
        for each in base.all("tskVariable"):
            self._outputs.append(self._tsk_variable(each))
        order = [each.attributes.get("name") for each in base.children]
        self._outputs.sort(key=lambda output: order.index(output.name))

    def _fuzzy_variable(self, element: Element) -> None:
        name = element.get("name")
        kind = element.attributes.get("type", "input").lower()
        if kind not in {"input", "output"}:
            raise malformed(element.position, f"type: expected input or output, got {kind[:40]!r}")
        low = parse_number(element.get("domainleft"), element.position)
        high = parse_number(element.get("domainright"), element.position)
        sets = tuple(self._set(name, term) for term in _bounded(element, "fuzzyTerm"))
        with locate_errors(element.position):
            if kind == "input":
                self._inputs.append(InputVariable(name, low, high, sets))
                return
            output = OutputVariable(
                name,
                low,
                high,
                sets,
                _choice(element, "accumulation", READ_DISJUNCTIONS, "MAX"),
                _choice(element, "defuzzifier", READ_DEFUZZIFIERS, "COG"),
            )
            self._outputs.append(_with_default(element, output))

    def _set(self, variable: str, term: Element) -> FuzzySet:
        name = term.get("name")
        complement = term.attributes.get("complement", "false").lower()
        if complement not in {"true", "false"}:
            raise malformed(
                term.position, f"complement: expected true or false, got {complement!r}"
            )
        if complement == "true":
            self._complements.add((variable, name))
        with locate_errors(term.position):
            return FuzzySet(name, read_shape(term))

    def _tsk_variable(self, element: Element) -> OutputVariable:
        _choice(element, "combination", {"WA": "wtaver"}, "WA")
        if element.attributes.get("type", "output").lower() != "output":
            raise malformed(element.position, "a tskVariable is an output")
        functions = tuple(self._function(term) for term in _bounded(element, "tskTerm"))
        with locate_errors(element.position):
            low, high = _noted_range(element) or self._reach(functions)
            output = OutputVariable(element.get("name"), low, high, functions)
            return _with_default(element, output)

    def _function(self, term: Element) -> LinearFunction:
        """The constant comes first, in contrast to other languages."""
        values = [parse_number(v.text.strip(), v.position) for v in term.all("tskValue")]
        order = term.attributes.get("order", "0").strip()
        wanted = {"0": 1, "1": 1 + len(self._inputs)}.get(order)
        if wanted is None:
            raise malformed(term.position, f"order: expected 0 or 1, got {order[:40]!r}")
        if len(values) != wanted:
            raise malformed(
                term.position,
                f"tskTerm of order {order}: expected {wanted} values, got {len(values)}",
            )
        with locate_errors(term.position):
            return LinearFunction(term.get("name"), values[0], tuple(values[1:]))

    def _reach(self, functions: tuple[LinearFunction, ...]) -> tuple[float, float]:
        """Least and greatest value over the ranges of the inputs, or about it if they are one."""
        ends = []
        for each in functions:
            low = high = each.constant
            for slope, variable in zip(each.coefficients, self._inputs, strict=False):
                low += min(slope * variable.low, slope * variable.high)
                high += max(slope * variable.low, slope * variable.high)
            ends += [low, high]
        if not ends:
            return 0.0, 1.0
        low, high = min(ends), max(ends)
        return (low, high) if low < high else (low - 0.5, high + 0.5)

    def _rule_base(self, base: Element) -> dict[str, str]:
        if base.tag not in RULE_BASES:
            raise malformed(
                base.position,
                f"{base.tag[:40]!r} cannot be expressed, only {', '.join(RULE_BASES)}",
            )
        methods = {
            "andMethod": _choice(base, "andMethod", READ_CONJUNCTIONS, "MIN"),
            "orMethod": _choice(base, "orMethod", READ_DISJUNCTIONS, "MAX"),
            "activationMethod": _choice(base, "activationMethod", READ_ACTIVATIONS, "MIN"),
        }
        for rule in base.children:
            if rule.tag not in {"rule", "tskRule"}:
                raise malformed(rule.position, f"expected a rule or tskRule, got {rule.tag[:40]!r}")
            if len(self._rules) >= MAX_RULES:
                raise malformed(rule.position, f"more than {MAX_RULES} rules")
            self._rules.append(LocatedRule(self._rule(rule, methods), rule.position))
            self._agree(rule, "activationMethod", methods["activationMethod"])
        return methods

    def _agree(self, element: Element, method: str, name: str) -> None:
        if self._operators.setdefault(method, name) != name:
            raise malformed(
                element.position,
                f"{method} {name!r}: rules before it have another, {self._operators[method]!r}, "
                "and only one can be expressed",
            )

    def _rule(self, element: Element, methods: dict[str, str]) -> Rule:
        clauses = list(element.one("antecedent").children)
        parts = tuple(self._clause(each, False) for each in clauses)
        consequent = element.one("consequent", "tskConsequent")
        for otherwise in consequent.all("else", "tskElse"):
            raise malformed(
                otherwise.position, "an else cannot be expressed; write a rule of its own"
            )
        then = consequent.one("then", "tskThen")
        consequents = tuple(self._clause(each, True) for each in then.children)
        weight = parse_number(element.attributes.get("weight", "1"), element.position)
        with locate_errors(element.position):
            if not parts:
                raise InvalidInput("a rule needs a clause in its antecedent")
            return Rule(self._joined(element, parts, methods), consequents, weight)

    def _joined(
        self, element: Element, parts: tuple[Is, ...], methods: dict[str, str]
    ) -> Antecedent:
        connector = element.attributes.get("connector", "and").lower()
        if connector not in {"and", "or"}:
            raise malformed(
                element.position, f"connector: expected and or or, got {connector[:40]!r}"
            )
        if len(parts) == 1:
            return parts[0]
        method = f"{connector}Method"
        known = READ_CONJUNCTIONS if connector == "and" else READ_DISJUNCTIONS
        own = method in element.attributes
        self._agree(
            element, method, _choice(element, method, known, "") if own else methods[method]
        )
        return And(parts) if connector == "and" else Or(parts)

    def _clause(self, element: Element, concludes: bool) -> Is:
        if element.tag not in {"clause", "tskClause"}:
            raise malformed(element.position, f"expected a clause, got {element.tag[:40]!r}")
        variable = element.one("variable").text.strip()
        term = element.one("term").text.strip()
        hedges: tuple[Hedge, ...] = ()
        if "modifier" in element.attributes:
            hedges = (_choice(element, "modifier", READ_MODIFIERS, ""),)
        if hedges == ("any",):
            return Is(variable, "", hedges)
        if (variable, term) in self._complements:
            hedges = () if concludes and hedges == ("not",) else (*hedges, "not")
        with locate_errors(element.position):
            return Is(variable, term, hedges)


def _bounded(element: Element, tag: str) -> list[Element]:
    for each in element.children:
        if each.tag != tag:
            raise malformed(each.position, f"{element.tag}: expected {tag}, got {each.tag[:40]!r}")
    if len(element.children) > MAX_SETS:
        raise malformed(element.children[MAX_SETS].position, f"more than {MAX_SETS} terms")
    return element.children


def _choice(element: Element, name: str, known: Mapping[str, Choice], default: str) -> Choice:
    found = element.attributes.get(name, default)
    if found in known:
        return known[found]
    raise malformed(
        element.position, f"{name}: expected one of {', '.join(known)}, got {found[:40]!r}"
    )


def _noted_range(element: Element) -> tuple[float, float] | None:
    if RANGE not in element.notes:
        return None
    found = re.fullmatch(
        r'domainleft="([^"]*)"\s+domainright="([^"]*)"', element.notes[RANGE].strip()
    )
    if found is None:
        raise malformed(
            element.position, f'<?{RANGE}?>: expected domainleft="MIN" domainright="MAX" in it'
        )
    return parse_number(found[1], element.position), parse_number(found[2], element.position)


def _with_default(element: Element, output: OutputVariable) -> OutputVariable:
    """The output with the default that is written; 0 where there is none, as the standard says."""
    value = parse_number(element.attributes.get("defaultValue", "0"), element.position)
    if value == output.fallback:
        return output
    return OutputVariable(
        output.name,
        output.low,
        output.high,
        output.sets,
        output.aggregation,
        output.defuzzifier,
        value,
    )
