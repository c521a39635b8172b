"""The fuzzy markup language (FML) of IEEE 1855-2016."""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.fml_reader import FmlReader
from omnidrive.fuzzy.files.fml_shapes import shape_lines
from omnidrive.fuzzy.files.fml_words import (
    ACTIVATIONS,
    AGGREGATIONS,
    CONJUNCTIONS,
    DEFUZZIFIERS,
    DISJUNCTIONS,
    MODIFIERS,
    NAMESPACE,
    RANGE,
)
from omnidrive.fuzzy.files.writer_checks import check_type_1, keyword, number_text
from omnidrive.fuzzy.files.xml_tree import read_xml
from omnidrive.fuzzy.rule_text import normalised
from omnidrive.fuzzy.rules import Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction, OutputVariable, Variable

_NO_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def read_fml(text: str) -> FuzzySystem:
    """System that a text in the fuzzy markup language describes.

    Namespaces are ignored. A default in the middle of the range is read as none, which means the
    same. The language gives a Sugeno output no range: where :func:`write_fml` has not noted it in a
    processing instruction, it is what the output's functions can reach.

    Raises:
        InvalidFuzzyFile: The text is malformed, or says what a :class:`FuzzySystem` cannot.
    """
    return FmlReader(read_xml(text)).system()


def write_fml(system: FuzzySystem) -> str:
    """Text of a system in the fuzzy markup language.

    The aggregation of a Sugeno output, which has no effect, is not written. A system without a
    default has the middle of its range written as one.

    Raises:
        InvalidInput: The language cannot say it.
    """
    check_type_1(system, "FML")
    if _NO_XML.search(system.name):
        raise InvalidInput(f"XML cannot name a system {system.name[:40]!r}; rename it")
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
    ends = f'domainleft="{number_text(variable.low)}" domainright="{number_text(variable.high)}"'
    if isinstance(variable, OutputVariable) and variable.is_sugeno:
        _word("defuzzifier", str(variable.defuzzifier), {"wtaver": "WA"})
        yield f'<tskVariable name={name} type="output" combination="WA" {_default(variable)}>'
        yield f"  <?{RANGE} {ends}?>"
        for function in variable.sets:
            if isinstance(function, LinearFunction):
                yield from (f"  {line}" for line in _function(function))
        yield "</tskVariable>"
        return
    kind = 'type="input"'
    if isinstance(variable, OutputVariable):
        accumulation = _word("aggregation", variable.aggregation, AGGREGATIONS)
        defuzzifier = _word("defuzzifier", str(variable.defuzzifier), DEFUZZIFIERS)
        kind = f'type="output" accumulation="{accumulation}" defuzzifier="{defuzzifier}"'
        kind += f" {_default(variable)}"
    yield f"<fuzzyVariable name={name} {ends} {kind}>"
    for each in variable.sets:
        if isinstance(each, FuzzySet):
            yield f"  <fuzzyTerm name={quoteattr(each.name)}>"
            yield from (f"    {line}" for line in shape_lines(each.name, each.upper))
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


def _rule_base(system: FuzzySystem) -> Iterator[str]:
    tag = "tskRuleBase" if system.is_sugeno else "mamdaniRuleBase"
    yield (
        f'<{tag} name="rules" activationMethod="{ACTIVATIONS[system.implication]}" '
        f'andMethod="{_word("conjunction", system.conjunction, CONJUNCTIONS)}" '
        f'orMethod="{_word("disjunction", system.disjunction, DISJUNCTIONS)}">'
    )
    first = {variable.name: variable.sets[0].name for variable in system.inputs}
    for number, rule in enumerate(system.rules, 1):
        yield from (f"  {line}" for line in _rule(number, rule, "tsk" * system.is_sugeno, first))
    yield f"</{tag}>"


def _rule(number: int, rule: Rule, prefix: str, first: dict[str, str]) -> Iterator[str]:
    """Lines of a rule; ``first`` has a set of each input, to stand after the modifier "any"."""

    def named(word: str) -> str:
        """A tag's name as rules of this kind have it."""
        return prefix + word[0].upper() + word[1:] if prefix else word

    antecedent = normalised(rule.antecedent)
    parts = (antecedent,) if isinstance(antecedent, Is) else antecedent.parts
    connector = "or" if isinstance(antecedent, Or) else "and"
    tag = named("rule")
    yield (
        f'<{tag} name="rule{number}" connector="{connector}" weight="{number_text(rule.weight)}">'
    )
    yield "  <antecedent>"
    for part in parts:
        if not isinstance(part, Is):
            raise InvalidInput(
                f"rule {number} joins by both 'and' and 'or', FML by one; split it at its 'or'"
            )
        yield f"    {_clause(number, 'clause', part, first)}"
    yield "  </antecedent>"
    yield f"  <{named('consequent')}>"
    yield f"    <{named('then')}>"
    for term in rule.consequents:
        yield f"      {_clause(number, named('clause'), term, {})}"
    yield f"    </{named('then')}>"
    yield f"  </{named('consequent')}>"
    yield f"</{tag}>"


def _clause(number: int, tag: str, term: Is, first: dict[str, str]) -> str:
    if len(term.hedges) > 1:
        raise InvalidInput(
            f"rule {number}: FML has one modifier in a clause, not {' '.join(term.hedges)!r}"
        )
    modifier = "".join(f' modifier="{MODIFIERS[hedge]}"' for hedge in term.hedges)
    each = term.set or first[term.variable]
    return (
        f"<{tag}{modifier}><variable>{escape(term.variable)}</variable>"
        f"<term>{escape(each)}</term></{tag}>"
    )


def _word(what: str, name: str, words: dict[str, str]) -> str:
    return keyword(what, name, words, "FML")
