"""Fuzzy system that a text in the fuzzy markup language describes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from omnidrive.errors import InvalidInput
from omnidrive.files.xml_elements import Element
from omnidrive.fuzzy.checks import MAX_NUMBER
from omnidrive.fuzzy.files.assembly import (
    LocatedRule,
    assemble_system,
    locate_errors,
    values_of,
)
from omnidrive.fuzzy.files.fml.parser import antecedent, consequents, parse, rule_bases
from omnidrive.fuzzy.membership import MAX_POINTS, Membership
from omnidrive.fuzzy.position import malformed, parse_number
from omnidrive.fuzzy.rules import And, Antecedent, Hedge, Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import (
    Defuzzifier,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
)

Name = TypeVar("Name", bound=str)

RANGE = "omnidrive"
"""Target of the processing instruction with the range of a Sugeno output."""

# FML's keywords by the names in this package.
CONJUNCTIONS = {
    "min": "MIN",
    "prod": "PROD",
    "lukasiewicz": "BDIF",
    "drastic": "DRP",
    "einstein": "EPROD",
    "hamacher": "HPROD",
    "nilpotent": "NILMIN",
}
"""Keywords in the text of the standard; its schema has BSUM and DRS for two of them."""

DISJUNCTIONS = {
    "max": "MAX",
    "probor": "PROBOR",
    "bsum": "BSUM",
    "drastic": "DRS",
    "einstein": "ESUM",
    "hamacher": "HSUM",
    "nilpotent": "NILMAX",
}
ACTIVATIONS = {"min": "MIN", "prod": "PROD"}
DEFUZZIFIERS: dict[Defuzzifier, str] = {
    "centroid": "COG",
    "bisector": "COA",
    "mom": "MOM",
    "lm": "LM",
    "rm": "RM",
}
MODIFIERS: dict[Hedge, str] = {
    "not": "not",
    "any": "any",
    "very": "very",
    "somewhat": "somewhat",
    "extremely": "intensify",
    "seldom": "seldom",
}
"""IEEE 1855's "extremely" is the cube; its "intensify" is fuzzylite's "extremely"."""

_READ_CONJUNCTIONS = {v: k for k, v in CONJUNCTIONS.items()} | {
    "BSUM": "lukasiewicz",
    "DRS": "drastic",
}
_READ_DISJUNCTIONS = {v: k for k, v in DISJUNCTIONS.items()}
_READ_ACTIVATIONS = {v: k for k, v in ACTIVATIONS.items()}
_READ_DEFUZZIFIERS: dict[str, Defuzzifier] = {v: k for k, v in DEFUZZIFIERS.items()}
_READ_MODIFIERS: dict[str, Hedge] = {v: k for k, v in MODIFIERS.items()}

INFINITE = MAX_NUMBER
"""Centre of the side of a Gaussian that no input reaches."""

SHAPES: dict[str, tuple[str, tuple[int, ...]]] = {
    "triangularShape": ("trimf", (0, 1, 2)),
    "trapezoidShape": ("trapmf", (0, 1, 2, 3)),
    "rightLinearShape": ("linsmf", (0, 1)),
    "leftLinearShape": ("linzmf", (0, 1)),
    "gaussianShape": ("gaussmf", (1, 0)),
    "sShape": ("smf", (0, 1)),
    "zShape": ("zmf", (0, 1)),
    "singletonShape": ("trimf", (0, 0, 0)),
}
"""Shape, and for each of its parameters the index of FML's parameter."""

_SUPPORTED_SHAPES = (
    *SHAPES,
    *("leftGaussianShape", "rightGaussianShape", "rectangularShape", "piShape", "pointSetShape"),
)


def read_fml(text: str) -> FuzzySystem:
    """Return the system that a text in the fuzzy markup language describes.

    Namespaces are ignored. A default in the middle of the range is read as None, which is
    equivalent. The language has no range of a Sugeno output: unless :func:`write_fml` has stored it
    in a processing instruction, it is the range of values of the output's functions.

    Raises:
        InvalidFuzzyFile: The text is malformed, or :class:`FuzzySystem` does not support a part.
    """
    return _Builder(parse(text)).system()


class _Builder:
    """Builder of the system."""

    def __init__(self, root: Element) -> None:
        self._root = root
        self._inputs: list[InputVariable] = []
        self._outputs: list[OutputVariable] = []
        self._complements: set[tuple[str, str]] = set()
        self._operators: dict[str, str] = {}
        self._rules: list[LocatedRule] = []

    def system(self) -> FuzzySystem:
        """Return the system."""
        self._variables()
        bases = [self._rule_base(each) for each in rule_bases(self._root)]
        defaults = {name: value for base in reversed(bases) for name, value in base.items()}
        return assemble_system(
            self._root.attributes.get("name", ""),
            self._inputs,
            self._outputs,
            self._rules,
            self._operators.get("andMethod", defaults.get("andMethod", "min")),
            self._operators.get("orMethod", defaults.get("orMethod", "max")),
            self._operators.get("activationMethod", defaults.get("activationMethod", "min")),
        )

    def _variables(self) -> None:
        """Read all inputs before the functions of the inputs."""
        base = self._root.one("knowledgeBase")
        for each in base.all("fuzzyVariable"):
            self._fuzzy_variable(each)
        for each in base.all("tskVariable"):
            self._outputs.append(self._tsk_variable(each))
        order = [each.get("name") for each in base.children]
        self._outputs.sort(key=lambda output: order.index(output.name))

    def _fuzzy_variable(self, element: Element) -> None:
        name = element.get("name")
        kind = element.attributes.get("type", "input").lower()
        if kind not in {"input", "output"}:
            raise malformed(element.position, f"type: expected input or output, got {kind[:40]!r}")
        low = parse_number(element.get("domainleft"), element.position)
        high = parse_number(element.get("domainright"), element.position)
        sets = tuple(self._set(name, term) for term in element.children)
        with locate_errors(element.position):
            if kind == "input":
                self._inputs.append(InputVariable(name, low, high, sets))
                return
            output = OutputVariable(
                name,
                low,
                high,
                sets,
                _choice(element, "accumulation", _READ_DISJUNCTIONS, "MAX"),
                _choice(element, "defuzzifier", _READ_DEFUZZIFIERS, "COG"),
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
        if len(term.children) != 1:
            raise malformed(
                term.position, f"fuzzyTerm: expected one shape, got {len(term.children)}"
            )
        with locate_errors(term.position):
            return FuzzySet(name, _membership(term.children[0]))

    def _tsk_variable(self, element: Element) -> OutputVariable:
        name = element.get("name")
        _choice(element, "combination", {"WA": "wtaver"}, "WA")
        if element.attributes.get("type", "output").lower() != "output":
            raise malformed(element.position, "type: a tskVariable must be an output")
        functions = tuple(self._function(term) for term in element.children)
        with locate_errors(element.position):
            low, high = _stored_range(element) or values_of(functions, self._inputs)
            output = OutputVariable(name, low, high, functions)
            return _with_default(element, output)

    def _function(self, term: Element) -> LinearFunction:
        name = term.get("name")
        values = [parse_number(each.text.strip(), each.position) for each in term.all("tskValue")]
        order = term.attributes.get("order", "0").strip()
        expected = {"0": 1, "1": 1 + len(self._inputs)}.get(order)
        if expected is None:
            raise malformed(term.position, f"order: expected 0 or 1, got {order[:40]!r}")
        if len(values) != expected:
            raise malformed(
                term.position,
                f"tskTerm of order {order}: expected {expected} values, got {len(values)}",
            )
        with locate_errors(term.position):
            return LinearFunction(name, values[0], tuple(values[1:]))

    def _rule_base(self, base: Element) -> dict[str, str]:
        """Read the rules of a base and return its methods."""
        methods = {
            "andMethod": _choice(base, "andMethod", _READ_CONJUNCTIONS, "MIN"),
            "orMethod": _choice(base, "orMethod", _READ_DISJUNCTIONS, "MAX"),
            "activationMethod": _choice(base, "activationMethod", _READ_ACTIVATIONS, "MIN"),
        }
        for rule in base.children:
            self._rules.append(LocatedRule(self._rule(rule, methods), rule.position))
            self._set_operator(rule, "activationMethod", methods["activationMethod"])
        return methods

    def _set_operator(self, element: Element, method: str, name: str) -> None:
        if self._operators.setdefault(method, name) != name:
            raise malformed(
                element.position,
                f"{method} {name!r} differs from {self._operators[method]!r} of the rules before "
                "it; only one is supported",
            )

    def _rule(self, element: Element, methods: dict[str, str]) -> Rule:
        parts = tuple(self._proposition(each, False) for each in antecedent(element))
        then = tuple(self._proposition(each, True) for each in consequents(element))
        weight = parse_number(element.attributes.get("weight", "1"), element.position)
        with locate_errors(element.position):
            if not parts:
                raise InvalidInput("a rule needs a clause in its antecedent")
            return Rule(self._antecedent(element, parts, methods), then, weight)

    def _antecedent(
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
        known = _READ_CONJUNCTIONS if connector == "and" else _READ_DISJUNCTIONS
        own = method in element.attributes
        self._set_operator(
            element, method, _choice(element, method, known, "") if own else methods[method]
        )
        return And(parts) if connector == "and" else Or(parts)

    def _proposition(self, clause: Element, is_consequent: bool) -> Is:
        variable = clause.one("variable").text.strip()
        term = clause.one("term").text.strip()
        hedges: tuple[Hedge, ...] = ()
        if "modifier" in clause.attributes:
            hedges = (_choice(clause, "modifier", _READ_MODIFIERS, ""),)
        if hedges == ("any",):
            return Is(variable, "", hedges)
        if (variable, term) in self._complements:
            hedges = () if is_consequent and hedges == ("not",) else (*hedges, "not")
        with locate_errors(clause.position):
            return Is(variable, term, hedges)


def _membership(shape: Element) -> Membership:
    """Return the membership function of a shape.

    A left Gaussian, which is 1 up to its centre, becomes a ``gauss2mf`` whose left side is beyond
    all numbers; a right one likewise. A piShape rises from its first parameter to its second and
    falls symmetrically, as in JFML.
    """
    if shape.tag not in _SUPPORTED_SHAPES:
        supported = ", ".join(_SUPPORTED_SHAPES)
        raise malformed(shape.position, f"{shape.tag[:40]!r} is not supported, only {supported}")
    with locate_errors(shape.position):
        if shape.tag == "pointSetShape":
            return _points(shape)
        if shape.tag in SHAPES:
            name, order = SHAPES[shape.tag]
            p = _parameters(shape, len(set(order)))
            return Membership(name, tuple(p[k] for k in order)).forward
        a, b = _parameters(shape, 2)
        if shape.tag == "leftGaussianShape":
            return Membership("gauss2mf", (1.0, -INFINITE, b, a))
        if shape.tag == "rightGaussianShape":
            return Membership("gauss2mf", (b, a, 1.0, INFINITE))
        if shape.tag == "rectangularShape":
            return Membership("trapmf", (a, a, b, b))
        return Membership("pimf", (a, b, b, b + (b - a))).forward


def _parameters(shape: Element, count: int) -> list[float]:
    expected = [f"param{k}" for k in range(1, count + 1)]
    if set(shape.attributes) - set(expected):
        extra = min(set(shape.attributes) - set(expected))
        raise malformed(
            shape.position,
            f"{shape.tag}: expected only {', '.join(expected)}, got also {extra[:40]!r}",
        )
    return [parse_number(shape.get(name), shape.position) for name in expected]


def _points(shape: Element) -> Membership:
    method = shape.attributes.get("interpolationMethod", "linear")
    if method != "linear":
        raise malformed(
            shape.position,
            f"pointSetShape: {method[:40]!r} interpolation is not supported, only linear",
        )
    points = list(shape.all("point"))
    if len(points) > MAX_POINTS:
        raise malformed(points[MAX_POINTS].position, f"more than {MAX_POINTS} points")
    coordinates = [parse_number(p.get(axis), p.position) for p in points for axis in ("x", "y")]
    return Membership("pointsmf", tuple(coordinates))


def _choice(element: Element, name: str, known: Mapping[str, Name], default: str) -> Name:
    """Return this package's name of the keyword in an attribute."""
    found = element.attributes.get(name, default)
    if found in known:
        return known[found]
    raise malformed(
        element.position, f"{name}: expected one of {', '.join(known)}, got {found[:40]!r}"
    )


def _stored_range(element: Element) -> tuple[float, float] | None:
    """Return the range in the processing instruction of :func:`write_fml`, or None."""
    if RANGE not in element.instructions:
        return None
    found = re.fullmatch(
        r'domainleft="([^"]*)"\s+domainright="([^"]*)"', element.instructions[RANGE].strip()
    )
    if found is None:
        raise malformed(
            element.position, f'<?{RANGE}?>: expected domainleft="MIN" domainright="MAX" in it'
        )
    return parse_number(found[1], element.position), parse_number(found[2], element.position)


def _with_default(element: Element, output: OutputVariable) -> OutputVariable:
    """Return the output with its default value; the standard's default is 0."""
    value = parse_number(element.attributes.get("defaultValue", "0"), element.position)
    if value == output.fallback:
        return output
    return replace(output, default=value)
