"""Text of a fuzzy system in the fuzzy markup language."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from xml.sax.saxutils import escape, quoteattr

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.fml.semantics import (
    ACTIVATIONS,
    CONJUNCTIONS,
    DEFUZZIFIERS,
    DISJUNCTIONS,
    INFINITE,
    MODIFIERS,
    RANGE,
    SHAPES,
)
from omnidrive.fuzzy.files.writer_checks import check_type_1, keyword, number_text
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rule_text import normalised
from omnidrive.fuzzy.rules import Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction, OutputVariable, Variable

NAMESPACE = "http://www.ieee1855.org"

_INVALID_IN_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_fml(system: FuzzySystem) -> str:
    """Return the text of a system in the fuzzy markup language.

    The aggregation of a Sugeno output, which has no effect, is not written. The default of an
    output without one is written as the middle of its range.

    Raises:
        InvalidInput: The language does not support a part of the system.
    """
    check_type_1(system, "FML")
    if _INVALID_IN_XML.search(system.name):
        raise InvalidInput(f"{system.name[:40]!r} is not a valid name of a system in XML")
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fuzzySystem xmlns="{NAMESPACE}" name={quoteattr(system.name)}>',
        "  <knowledgeBase>",
    ]
    for variable in system.variables:
        lines += [f"    {line}" for line in _variable(variable)]
    lines += ["  </knowledgeBase>", *(f"  {line}" for line in _rule_base(system)), "</fuzzySystem>"]
    return "\n".join(lines) + "\n"


def _variable(variable: Variable) -> Iterator[str]:
    name = quoteattr(variable.name)
    limits = f'domainleft="{number_text(variable.low)}" domainright="{number_text(variable.high)}"'
    if isinstance(variable, OutputVariable) and variable.is_sugeno:
        _keyword("defuzzifier", str(variable.defuzzifier), {"wtaver": "WA"})
        yield f'<tskVariable name={name} type="output" combination="WA" {_default(variable)}>'
        yield f"  <?{RANGE} {limits}?>"
        for function in variable.sets:
            if isinstance(function, LinearFunction):
                yield from (f"  {line}" for line in _function(function))
        yield "</tskVariable>"
        return
    kind = 'type="input"'
    if isinstance(variable, OutputVariable):
        defuzzifiers = {str(name): each for name, each in DEFUZZIFIERS.items()}
        accumulation = _keyword("aggregation", variable.aggregation, DISJUNCTIONS)
        defuzzifier = _keyword("defuzzifier", str(variable.defuzzifier), defuzzifiers)
        kind = f'type="output" accumulation="{accumulation}" defuzzifier="{defuzzifier}"'
        kind += f" {_default(variable)}"
    yield f"<fuzzyVariable name={name} {limits} {kind}>"
    for each in variable.sets:
        if isinstance(each, FuzzySet):
            yield f"  <fuzzyTerm name={quoteattr(each.name)}>"
            yield from (f"    {line}" for line in _shape(each.name, each.upper))
            yield "  </fuzzyTerm>"
    yield "</fuzzyVariable>"


def _default(output: OutputVariable) -> str:
    return f'defaultValue="{number_text(output.fallback)}"'


def _function(function: LinearFunction) -> Iterator[str]:
    order = 1 if function.coefficients else 0
    yield f'<tskTerm name={quoteattr(function.name)} order="{order}">'
    for value in (function.constant, *function.coefficients):
        yield f"  <tskValue>{number_text(value)}</tskValue>"
    yield "</tskTerm>"


def _shape(name: str, function: Membership) -> Iterator[str]:
    """Yield the lines of a shape; ``name`` is that of the set, for messages."""
    function = function.forward
    p = function.parameters
    if function.shape == "pointsmf":
        yield '<pointSetShape interpolationMethod="linear">'
        for x, y in zip(p[::2], p[1::2], strict=True):
            yield f'  <point x="{number_text(x)}" y="{number_text(y)}"/>'
        yield "</pointSetShape>"
        return
    for tag, (shape, order) in SHAPES.items():
        if shape == function.shape:
            yield _shape_element(tag, tuple(p[order.index(k)] for k in range(len(p))))
            return
    yield _special_shape(name, function)


def _special_shape(name: str, function: Membership) -> str:
    p = function.parameters
    if function.shape == "gauss2mf" and p[:2] == (1.0, -INFINITE):
        return _shape_element("leftGaussianShape", (p[3], p[2]))
    if function.shape == "gauss2mf" and p[2:] == (1.0, INFINITE):
        return _shape_element("rightGaussianShape", (p[1], p[0]))
    if function.shape == "pimf" and p[1] == p[2] and p[3] == p[1] + (p[1] - p[0]):
        return _shape_element("piShape", p[:2])
    raise InvalidInput(f"FML does not support this {function.shape} (set {name!r}: {function})")


def _shape_element(tag: str, parameters: tuple[float, ...]) -> str:
    each = " ".join(f'param{k}="{number_text(p)}"' for k, p in enumerate(parameters, 1))
    return f"<{tag} {each}/>"


def _rule_base(system: FuzzySystem) -> Iterator[str]:
    tag = "tskRuleBase" if system.is_sugeno else "mamdaniRuleBase"
    yield (
        f'<{tag} name="rules" activationMethod="{ACTIVATIONS[system.implication]}" '
        f'andMethod="{_keyword("conjunction", system.conjunction, CONJUNCTIONS)}" '
        f'orMethod="{_keyword("disjunction", system.disjunction, DISJUNCTIONS)}">'
    )
    first = {each.name: each.sets[0].name for each in system.inputs if each.sets}
    for number, rule in enumerate(system.rules, 1):
        yield from (f"  {line}" for line in _rule(number, rule, "tsk" * system.is_sugeno, first))
    yield f"</{tag}>"


def _rule(number: int, rule: Rule, prefix: str, first: dict[str, str]) -> Iterator[str]:
    """Yield the lines of a rule.

    Args:
        number: Number of the rule.
        rule: The rule.
        prefix: Prefix of the tags: ``tsk`` in a Sugeno system.
        first: A set of each input, which is written after the modifier "any".
    """

    def prefixed(tag: str) -> str:
        """Return the tag with the prefix."""
        return prefix + tag[0].upper() + tag[1:] if prefix else tag

    antecedent = normalised(rule.antecedent)
    parts = (antecedent,) if isinstance(antecedent, Is) else antecedent.parts
    connector = "or" if isinstance(antecedent, Or) else "and"
    tag = prefixed("rule")
    yield (
        f'<{tag} name="rule{number}" connector="{connector}" weight="{number_text(rule.weight)}">'
    )
    yield "  <antecedent>"
    for part in parts:
        if not isinstance(part, Is):
            raise InvalidInput(
                f"rule {number}: FML does not support both 'and' and 'or' in one rule; split it at "
                "its 'or'"
            )
        yield f"    {_clause(number, 'clause', part, first)}"
    yield "  </antecedent>"
    yield f"  <{prefixed('consequent')}>"
    yield f"    <{prefixed('then')}>"
    for each in rule.consequents:
        yield f"      {_clause(number, prefixed('clause'), each, {})}"
    yield f"    </{prefixed('then')}>"
    yield f"  </{prefixed('consequent')}>"
    yield f"</{tag}>"


def _clause(number: int, tag: str, proposition: Is, first: dict[str, str]) -> str:
    if len(proposition.hedges) > 1:
        hedges = " ".join(proposition.hedges)
        raise InvalidInput(f"rule {number}: FML supports one modifier in a clause, not {hedges!r}")
    modifier = "".join(f' modifier="{MODIFIERS[hedge]}"' for hedge in proposition.hedges)
    term = proposition.set or first.get(proposition.variable, "")
    if not term:
        raise InvalidInput(
            f"rule {number}: FML needs a set of {proposition.variable!r} for 'any'; remove the "
            "proposition, which is always true"
        )
    return (
        f"<{tag}{modifier}><variable>{escape(proposition.variable)}</variable>"
        f"<term>{escape(term)}</term></{tag}>"
    )


def _keyword(what: str, name: str, keywords: Mapping[str, str]) -> str:
    return keyword(what, name, keywords, "FML")
