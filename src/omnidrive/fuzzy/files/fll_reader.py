"""Reads the fuzzylite language (FLL)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import (
    LocatedRule,
    all_joins,
    assembled,
    hedged_consequent,
    locate_errors,
    shared_conclusion,
    stays_in_range,
)
from omnidrive.fuzzy.files.fll_terms import Word, read_term
from omnidrive.fuzzy.files.fll_words import (
    AGGREGATIONS,
    CONJUNCTIONS,
    DEFUZZIFIERS,
    DISJUNCTIONS,
    IMPLICATIONS,
    KEYS,
)
from omnidrive.fuzzy.files.source import Position, malformed, parse_number
from omnidrive.fuzzy.rule_text import parse_rule
from omnidrive.fuzzy.rules import And, Or
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES, FuzzySystem
from omnidrive.fuzzy.variables import (
    MAX_SETS,
    Defuzzifier,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
)


def system_of(text: str) -> FuzzySystem:
    """System that a text describes; see :func:`omnidrive.fuzzy.files.fll.read_fll`."""
    components = list(_components(text))
    by_kind = {kind: [c for c in components if c.kind == kind] for kind in KEYS}
    if len(by_kind["Engine"]) > 1:
        raise malformed(by_kind["Engine"][1].position, "a second Engine: expected one in a file")
    for kind in ("InputVariable", "OutputVariable"):
        if len(by_kind[kind]) > MAX_VARIABLES:
            raise malformed(by_kind[kind][MAX_VARIABLES].position, f"more than {MAX_VARIABLES}")
    width = len(by_kind["InputVariable"])
    inputs = [_input(each) for each in by_kind["InputVariable"]]
    outputs = [_output(each, width) for each in by_kind["OutputVariable"]]
    rules, operators = _rules(by_kind["RuleBlock"], any(o.is_sugeno for o in outputs))
    for component, output in zip(by_kind["OutputVariable"], outputs, strict=True):
        _check_output(component, output, rules)
    name = by_kind["Engine"][0].name if by_kind["Engine"] else ""
    return assembled(name, inputs, outputs, rules, *operators)


class _Line(NamedTuple):
    key: str
    position: Position
    value: str
    value_position: Position

    def words(self) -> list[Word]:
        """The value split at blanks, each word with its place."""
        return [
            Word(match[0], self.value_position.after(self.value[: match.start()]))
            for match in re.finditer(r"\S+", self.value)
        ]


class _Component:
    """Part of an engine: what stands under a heading."""

    def __init__(self, heading: _Line) -> None:
        self.kind = heading.key
        self.position = heading.position
        self.name = heading.value
        self.listed: list[_Line] = []
        self._fields: dict[str, _Line] = {}

    def add(self, line: _Line) -> None:
        """Take in a line below the heading; refuse a key that is unknown, or there twice."""
        if line.key not in KEYS[self.kind]:
            known = ", ".join(sorted(KEYS[self.kind]))
            raise malformed(
                line.position, f"{self.kind} has no {line.key[:40]!r}: expected one of {known}"
            )
        if line.key in {"term", "rule"}:
            self.listed.append(line)
        elif line.key in self._fields:
            raise malformed(line.position, f"{line.key!r} is there twice")
        else:
            self._fields[line.key] = line

    def get(self, *keys: str) -> _Line | None:
        """The line of a key; None: there is none, or it says ``none``."""
        for key in keys:
            line = self._fields.get(key)
            if line is not None and line.value not in {"", "none"}:
                return line
        return None

    def is_true(self, *keys: str, default: bool = False) -> bool:
        """What the first of the keys that is there says; refuse all but true and false."""
        line = self.get(*keys)
        if line is None:
            return default
        if line.value not in {"true", "false"}:
            raise malformed(line.value_position, f"expected true or false, got {line.value[:40]!r}")
        return line.value == "true"

    def choice(self, known: dict[str, str], *keys: str) -> str | None:
        """Our name of an operator."""
        line = self.get(*keys)
        return None if line is None else _choice(line, line.value, known)

    def check_enabled(self) -> None:
        """Refuse what is switched off."""
        if not self.is_true("enabled", default=True):
            line = self.get("enabled")
            raise malformed(
                line.position if line else None,
                f"a {self.kind} that is not enabled cannot be expressed; remove it",
            )


def _choice(line: _Line, found: str, known: dict[str, str]) -> str:
    for ours, theirs in known.items():
        if theirs == found:
            return ours
    raise malformed(
        line.value_position,
        f"{line.key}: expected one of {', '.join(known.values())}, got {found[:40]!r}",
    )


def _components(text: str) -> Iterator[_Component]:
    component: _Component | None = None
    for count, row in enumerate(text.split("\n"), 1):
        bare = row.partition("#")[0]
        if not bare.strip():
            continue
        key, colon, rest = bare.partition(":")
        position = Position(count, len(key) - len(key.lstrip()) + 1)
        if not colon:
            raise malformed(position, f"expected 'key: value', got {bare.strip()[:40]!r}")
        column = len(key) + 2 + len(rest) - len(rest.lstrip())
        line = _Line(key.strip(), position, rest.strip(), Position(count, column))
        if line.key in KEYS:
            if component:
                yield component
            component = _Component(line)
        elif component is None:
            raise malformed(position, f"expected {', '.join(KEYS)}, got {line.key[:40]!r}")
        else:
            component.add(line)
    if component is None:
        raise malformed(Position(1, 1), f"there is nothing in it: expected {', '.join(KEYS)}")
    yield component


def _input(component: _Component) -> InputVariable:
    component.check_enabled()
    component.is_true("lock-range")
    low, high = _range(component)
    sets = _terms(component, 0)
    with locate_errors(component.position):
        for each in sets:
            if not isinstance(each, FuzzySet):
                raise InvalidInput(f"{each.name!r}: an input is made of fuzzy sets")
        fuzzy = tuple(each for each in sets if isinstance(each, FuzzySet))
        return InputVariable(component.name, low, high, fuzzy)


def _output(component: _Component, inputs: int) -> OutputVariable:
    component.check_enabled()
    low, high = _range(component)
    sets = _terms(component, inputs)
    defuzzifier = _defuzzifier(component)
    aggregation = component.choice(AGGREGATIONS, "aggregation", "accumulation")
    previous = component.get("lock-previous", "lock-valid")
    if component.is_true("lock-previous", "lock-valid"):
        raise malformed(
            previous.position if previous else None,
            "an output that keeps its previous value cannot be expressed; give it a default",
        )
    default = component.get("default")
    value = None
    if default is not None and default.value.lower() != "nan":
        value = parse_number(default.value, default.value_position)
    functions = tuple(each for each in sets if isinstance(each, LinearFunction))
    fuzzy = tuple(each for each in sets if isinstance(each, FuzzySet))
    with locate_errors(component.position):
        if fuzzy and functions:
            raise InvalidInput(f"output {component.name!r} mixes fuzzy sets and functions")
        if fuzzy and defuzzifier in {"wtaver", "wtsum"}:
            raise InvalidInput(
                f"output {component.name!r}: {DEFUZZIFIERS[defuzzifier]} of fuzzy sets cannot be "
                "expressed, only of Constant and Linear"
            )
        if fuzzy and aggregation is None:
            raise InvalidInput(
                f"output {component.name!r} needs an aggregation, such as aggregation: Maximum"
            )
        return OutputVariable(
            component.name, low, high, functions or fuzzy, aggregation or "max", defuzzifier, value
        )


def _terms(component: _Component, inputs: int) -> list[FuzzySet | LinearFunction]:
    if len(component.listed) > MAX_SETS:
        raise malformed(component.listed[MAX_SETS].position, f"more than {MAX_SETS} terms")
    sets = []
    for line in component.listed:
        words = line.words()
        if len(words) < 2:
            raise malformed(line.value_position, "expected a name, a class and its parameters")
        sets.append(read_term(words[0].text, words[1], words[2:], inputs))
    return sets


def _range(component: _Component) -> tuple[float, float]:
    line = component.get("range")
    if line is None:
        raise malformed(component.position, f"{component.name[:40]!r}: expected a range: MIN MAX")
    words = line.words()
    if len(words) != 2:
        raise malformed(line.value_position, f"expected two numbers, got {line.value[:40]!r}")
    return parse_number(*words[0]), parse_number(*words[1])


def _defuzzifier(component: _Component) -> Defuzzifier:
    line = component.get("defuzzifier")
    if line is None:
        raise malformed(component.position, f"{component.name[:40]!r}: expected a defuzzifier")
    kind, *rest = line.words()
    _choice(line, kind.text, {str(k): v for k, v in DEFUZZIFIERS.items()})
    ours = next(k for k, v in DEFUZZIFIERS.items() if v == kind.text)
    if ours in {"wtaver", "wtsum"}:
        if [each.text for each in rest] not in ([], ["Automatic"], ["TakagiSugeno"]):
            raise malformed(
                rest[0].position, f"expected TakagiSugeno or Automatic, got {rest[0].text[:40]!r}"
            )
    elif len(rest) > 1 or (rest and parse_number(*rest[0]) < 1):
        raise malformed(rest[0].position, "expected a resolution, a number from 1")
    return ours


def _rules(
    blocks: list[_Component], is_sugeno: bool
) -> tuple[list[LocatedRule], tuple[str, str, str]]:
    rules: list[LocatedRule] = []
    chosen: dict[str, str] = {}
    articles = {"conjunction": "a", "disjunction": "a", "implication": "an"}
    tables = {
        "conjunction": CONJUNCTIONS,
        "disjunction": DISJUNCTIONS,
        "implication": IMPLICATIONS,
    }
    for block in blocks:
        block.check_enabled()
        keys = {key: (key,) for key in tables}
        if not _activates(block):
            keys["implication"] = ("activation",)
        found = {key: block.choice(tables[key], *keys[key]) for key in tables}
        here = _block_rules(block, MAX_RULES - len(rules))
        used = all_joins(here)
        for key, needed in (
            ("conjunction", And in used),
            ("disjunction", Or in used),
            ("implication", not is_sugeno and bool(here)),
        ):
            ours = found[key]
            if ours is None and needed:
                raise malformed(
                    block.position,
                    f"its rules need {articles[key]} {key}: expected it in this block",
                )
            if ours is not None and chosen.setdefault(key, ours) != ours:
                line = block.get(*keys[key])
                raise malformed(
                    line.position if line else None,
                    f"rule blocks with different {key}s cannot be expressed",
                )
        rules += here
    return rules, (
        chosen.get("conjunction", "min"),
        chosen.get("disjunction", "max"),
        chosen.get("implication", "min"),
    )


def _activates(block: _Component) -> bool:
    """Check that every rule fires as far as it holds; False: it is fuzzylite 5's implication."""
    line = block.get("activation")
    if line is None or line.value == "General":
        return True
    if line.value in CONJUNCTIONS.values() and block.get("implication") is None:
        return False
    raise malformed(
        line.value_position,
        f"activation: expected General, got {line.value[:40]!r}, which cannot be expressed",
    )


def _block_rules(block: _Component, most: int) -> list[LocatedRule]:
    if len(block.listed) > most:
        raise malformed(block.listed[most].position, f"more than {MAX_RULES} rules")
    rules = []
    for line in block.listed:
        rule = parse_rule(line.value, line.value_position)
        if hedged := hedged_consequent(rule):
            raise malformed(
                line.value_position,
                f"{hedged!r}: in a consequent fuzzylite applies a hedge to the strength of the "
                "rule, which cannot be expressed",
            )
        rules.append(LocatedRule(rule, line.value_position))
    return rules


def _check_output(component: _Component, output: OutputVariable, rules: list[LocatedRule]) -> None:
    """Refuse what fuzzylite would do and a system of ours does not."""
    line = component.get("lock-range")
    if line is not None and component.is_true("lock-range") and not stays_in_range(output):
        raise malformed(
            line.position,
            f"output {output.name!r} may leave its range: clipping cannot be expressed",
        )
    line = component.get("aggregation")
    if output.is_sugeno and component.choice(AGGREGATIONS, "aggregation") not in {None, "sum"}:
        assert line is not None
        shared = shared_conclusion(output.name, rules)
        if shared is not None:
            raise malformed(
                line.position,
                f"{line.value} joins rules with one consequent (line {shared.position.line}) as no "
                "system here does: expected none or UnboundedSum",
            )
