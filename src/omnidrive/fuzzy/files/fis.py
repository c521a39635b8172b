"""Matlab's ``.fis`` files: Mamdani and Sugeno systems of type 1 and interval type 2."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple, cast

from omnidrive.errors import closest
from omnidrive.fuzzy.files.assembly import locate_errors
from omnidrive.fuzzy.files.fis_lines import Cursor, Section, sections
from omnidrive.fuzzy.files.fis_words import (
    AGGREGATION,
    AND,
    DEFUZZIFIER,
    IMPLICATION,
    OR,
    REDUCTION,
    SHAPE_NAMES,
)
from omnidrive.fuzzy.files.fis_writer import write_fis
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.position import Position, malformed
from omnidrive.fuzzy.rules import And, Hedge, Is, Or, Rule
from omnidrive.fuzzy.system import Algorithm, FuzzySystem
from omnidrive.fuzzy.variables import (
    Defuzzifier,
    Footprint,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
    Variable,
)

__all__ = ["read_fis", "write_fis"]

_SYSTEM_KEYS = (
    *("Name", "Type", "Version", "NumInputs", "NumOutputs", "NumRules"),
    *("AndMethod", "OrMethod", "ImpMethod", "AggMethod", "DefuzzMethod", "TypeReductionMethod"),
)

_HEDGES: dict[str, tuple[Hedge, ...]] = {
    "": (),
    "01": ("seldom",),
    "05": ("somewhat",),
    "2": ("very",),
    "4": ("very", "very"),
}
"""Octave's and fuzzylite's hedges, by the decimals of a set's number."""

_MATLAB_LAG = (0.2, 0.2)
"""LowerLag where a type-2 file does not say it; LowerScale is then 1."""


def read_fis(text: str) -> FuzzySystem:
    """System that the text of a ``.fis`` file describes.

    Matlab's files of any age, and Octave's as far as this package knows their operators: its hedges
    somewhat, very and "very very" are the fractions .05, .2 and .4 of a set's number in a rule;
    fuzzylite's seldom is .01. Octave's "extremely" (.3), a cube, is refused.

    A file is of type 2 if it names a TypeReductionMethod, or if any set has a LowerScale and
    LowerLag: ``MF1='low':'trimf',[0 1 2],[0.9],[0.2 0.2]``. A set without them then has Matlab's
    default, scale 1 and lag 0.2. Matlab defines the lag of a curve that never reaches zero by a
    cut-off that it does not document; :class:`~omnidrive.fuzzy.system.Footprint` needs none, so
    that such lower functions differ a little from Matlab's.

    Counts (NumInputs, NumMFs, ...), the name and the version may be missing; counts must be right.
    An old gbellmf may have a fourth parameter, 0. A rule without any antecedent is refused.

    Raises:
        InvalidFuzzyFile: The text describes no such system; the message says where, and what was
            expected.
    """
    return _Reader(text).system()


class _Set(NamedTuple):
    """A line ``MFk=...`` of a file."""

    name: str
    position: Position
    shape: str
    parameters: tuple[float, ...]
    footprint: tuple[tuple[float, ...], ...]


class _Reader:
    def __init__(self, text: str) -> None:
        self._sections = sections(text)
        if ("system", 0) not in self._sections:
            raise malformed(Position(1, 1), "expected [System], which the file has not")
        self._head = self._sections["system", 0]
        for key, position, _ in self._head.entries.values():
            _check_key(self._head, key, position, _SYSTEM_KEYS)

    def system(self) -> FuzzySystem:
        """The system that the sections describe."""
        head = self._head
        kinds = {"mamdani": "mamdani", "sugeno": "sugeno"}
        sugeno = _choice(head, "Type", kinds) == "sugeno"
        algorithm = _choice(head, "TypeReductionMethod", REDUCTION, "km")
        conjunction = _choice(head, "AndMethod", AND)
        disjunction = _choice(head, "OrMethod", OR)
        implication = _choice(head, "ImpMethod", IMPLICATION)
        aggregation = _choice(head, "AggMethod", AGGREGATION)
        defuzzifier = cast("Defuzzifier", _choice(head, "DefuzzMethod", DEFUZZIFIER[sugeno]))
        ins, outs = self._variables("input", False), self._variables("output", sugeno)
        is_type2 = "typereductionmethod" in head.entries or any(
            each.footprint for _, sets in (*ins, *outs) for each in sets
        )
        seen: set[str] = set()
        inputs = []
        for section, sets in ins:
            name, low, high = _named_range(section, seen)
            own = tuple(_fuzzy_set(each, is_type2) for each in sets)
            with locate_errors(section.position):
                inputs.append(InputVariable(name, low, high, own))
        outputs = []
        for section, sets in outs:
            name, low, high = _named_range(section, seen)
            made = (
                tuple(_linear(each, len(inputs)) for each in sets)
                if sugeno
                else tuple(_fuzzy_set(each, is_type2) for each in sets)
            )
            with locate_errors(section.position):
                outputs.append(OutputVariable(name, low, high, made, aggregation, defuzzifier))
        rules = self._rules(inputs, outputs)
        title = _text(head, "Name") if "name" in head.entries else ""
        with locate_errors(head.position):
            return FuzzySystem(
                title,
                tuple(inputs),
                tuple(outputs),
                rules,
                conjunction,
                disjunction,
                implication,
                cast("Algorithm", algorithm),
            )

    def _variables(self, kind: str, sugeno: bool) -> list[tuple[Section, list[_Set]]]:
        """Each section of a kind, with its sets."""
        found = sorted(
            (index, each) for (other, index), each in self._sections.items() if other == kind
        )
        title = kind.capitalize()
        for wanted, (index, section) in enumerate(found, 1):
            if index != wanted:
                raise malformed(
                    section.position, f"expected [{title}{wanted}] first, got [{section.title}]"
                )
        _check_count(self._head, f"Num{title}s", len(found), f"[{title}] sections")
        if not found:
            raise malformed(self._head.position, f"expected a section [{title}1]")
        return [(section, _sets(section, sugeno)) for _, section in found]

    def _rules(
        self, inputs: list[InputVariable], outputs: list[OutputVariable]
    ) -> tuple[Rule, ...]:
        section = self._sections.get(("rules", 0))
        if section is None:
            raise malformed(self._head.position, "expected a section [Rules]")
        _check_count(self._head, "NumRules", len(section.lines), "lines in [Rules]")
        if not section.lines:
            raise malformed(section.position, "expected a rule in [Rules], got none")
        named = [_Numbered(each) for each in inputs], [_Numbered(each) for each in outputs]
        return tuple(_rule(line, *named) for line in section.lines)


def _sets(section: Section, sugeno: bool) -> list[_Set]:
    found: dict[int, _Set] = {}
    for key, position, value in section.entries.values():
        match = re.fullmatch(r"(?i:mf)(\d{1,9})", key)
        if match is None:
            _check_key(section, key, position, ("Name", "Range", "NumMFs", "MF1, MF2, ..."))
            continue
        if int(match[1]) in found:
            raise malformed(position, f"MF{int(match[1])} is there twice in [{section.title}]")
        found[int(match[1])] = _set(key, position, value, sugeno)
    for wanted, index in enumerate(sorted(found), 1):
        if index != wanted:
            raise malformed(found[index].position, f"expected MF{wanted} first, got MF{index}")
    _check_count(section, "NumMFs", len(found), "sets")
    sets = [found[index] for index in sorted(found)]
    names: set[str] = set()
    for each in sets:
        if each.name in names:
            raise malformed(each.position, f"the name {each.name[:40]!r} is there twice")
        names.add(each.name)
    return sets


def _set(key: str, position: Position, value: Cursor, sugeno: bool) -> _Set:
    name = value.quoted(f"the name of {key}")
    value.expect(":", "after the name")
    at = value.position
    shape = value.quoted("a membership function")
    known = ("constant", "linear") if sugeno else SHAPE_NAMES
    if shape not in known:
        close = closest(shape, known)
        hint = f"did you mean {close!r}? " if close else ""
        what = "function of a Sugeno output" if sugeno else "membership function"
        raise malformed(
            at, f"there is no {what} {shape[:40]!r}; {hint}There are {', '.join(known)}"
        )
    value.expect(",", "after the function")
    parameters = value.numbers("parameters")
    footprint: list[tuple[float, ...]] = []
    while len(footprint) < 2 and not sugeno and value.mark(","):
        at = value.position
        footprint.append(value.numbers(("LowerScale", "LowerLag")[len(footprint)]))
        if len(footprint[-1]) not in {1, len(footprint)}:
            wanted = ("LowerScale: one number", "LowerLag: one number or two")[len(footprint) - 1]
            raise malformed(at, f"expected {wanted}, got {len(footprint[-1])}")
    value.end()
    return _Set(name, position, shape, parameters, tuple(footprint))


def _fuzzy_set(each: _Set, is_type2: bool) -> FuzzySet:
    parameters = each.parameters
    if each.shape == "gbellmf" and len(parameters) == 4 and parameters[3] == 0.0:
        parameters = parameters[:3]
    with locate_errors(each.position):
        lower = None
        if is_type2:
            scale = each.footprint[0][0] if each.footprint else 1.0
            lags = each.footprint[1] if len(each.footprint) > 1 else _MATLAB_LAG
            lower = Footprint(scale, *lags)
        return FuzzySet(each.name, Membership(each.shape, parameters), lower)


def _linear(each: _Set, inputs: int) -> LinearFunction:
    wanted = 1 if each.shape == "constant" else inputs + 1
    if len(each.parameters) != wanted:
        rule = "a number" if wanted == 1 else f"{inputs} coefficients and a constant"
        raise malformed(
            each.position, f"'{each.shape}' needs {rule}, got {len(each.parameters)} numbers"
        )
    *coefficients, constant = each.parameters
    with locate_errors(each.position):
        return LinearFunction(each.name, constant, tuple(coefficients))


def _named_range(section: Section, seen: set[str]) -> tuple[str, float, float]:
    position = _entry(section, "Name")[0]
    name = _text(section, "Name")
    if name in seen:
        raise malformed(position, f"there are two variables {name[:40]!r}; rename one")
    seen.add(name)
    position, value = _entry(section, "Range")
    low_high = value.numbers("the range [low high]")
    value.end()
    if len(low_high) != 2 or not low_high[0] < low_high[1]:
        shown = " ".join(f"{each:g}" for each in low_high[:4])
        raise malformed(position, f"expected Range=[low high] with low < high, got [{shown}]")
    return name, *low_high


def _rule(line: Cursor, inputs: list[_Numbered], outputs: list[_Numbered]) -> Rule:
    start = line.position
    parts = tuple(term for each in inputs if (term := each.term(line)) is not None)
    line.expect(",", f"after the numbers of {len(inputs)} sets, one per input")
    at = line.position
    consequents = tuple(term for each in outputs if (term := each.term(line)) is not None)
    line.expect("(", f"before the weight, after the numbers of {len(outputs)} sets, one per output")
    weight_at = line.position
    weight = line.number("a weight")
    line.expect(")", "after the weight")
    line.expect(":", "after the weight")
    connective_at = line.position
    connective = line.number("1 (and) or 2 (or)")
    line.end()
    if connective not in {1.0, 2.0}:
        raise malformed(connective_at, f"expected 1 (and) or 2 (or), got {connective:g}")
    if not parts:
        raise malformed(start, "the rule has no antecedent: every input's set is 0")
    if not consequents:
        raise malformed(at, "the rule has no consequent: every output's set is 0")
    for term in consequents:
        if term.hedges and (outputs[0].is_sugeno or term.hedges != ("not",)):
            raise malformed(at, f"a consequent cannot be {' '.join(term.hedges)!r}")
    joined = And if connective == 1.0 else Or
    with locate_errors(weight_at):
        return Rule(parts[0] if len(parts) == 1 else joined(parts), consequents, weight)


class _Numbered:
    """A variable whose sets rules call by their numbers."""

    def __init__(self, variable: Variable) -> None:
        self.is_sugeno = isinstance(variable, OutputVariable) and variable.is_sugeno
        self._name = variable.name
        self._sets = [each.name for each in variable.sets]
        self._known: dict[str, Is | None] = {}

    def term(self, line: Cursor) -> Is | None:
        """What the next number says: a minus negates, 0 leaves the variable out."""
        position = line.position
        word = line.word(f"the number of a set of {self._name!r}")
        if word not in self._known:
            self._known[word] = self._read(word, position)
        return self._known[word]

    def _read(self, word: str, position: Position) -> Is | None:
        match = re.fullmatch(r"([+-]?)(\d{1,9})(?:\.(\d{0,20}))?", word)
        if match is None:
            raise malformed(
                position, f"expected the number of a set of {self._name!r}, got {word[:40]!r}"
            )
        sign, index, decimals = match[1], int(match[2]), (match[3] or "").rstrip("0")
        if index > len(self._sets) or (index == 0 and decimals):
            raise malformed(
                position, f"{self._name!r} has sets 1 to {len(self._sets)}, got {word!r}"
            )
        if decimals not in _HEDGES:
            known = "; ".join(f".{d} {' '.join(h)}" for d, h in _HEDGES.items() if d)
            what = "Octave's 'extremely', a cube" if decimals == "3" else "a hedge"
            raise malformed(
                position, f".{decimals} is {what} that is not known here; known are {known}"
            )
        if index == 0:
            return None
        negation: tuple[Hedge, ...] = ("not",) if sign == "-" else ()
        return Is(self._name, self._sets[index - 1], negation + _HEDGES[decimals])


def _entry(section: Section, key: str) -> tuple[Position, Cursor]:
    if key.lower() not in section.entries:
        raise malformed(section.position, f"expected {key}=... in [{section.title}]")
    value = section.entries[key.lower()][2]
    return value.position, value


def _text(section: Section, key: str) -> str:
    _, value = _entry(section, key)
    text = value.quoted(f"the {key.lower()}")
    value.end()
    return text


def _choice(
    section: Section, key: str, known: Mapping[str, str], default: str | None = None
) -> str:
    if default is not None and key.lower() not in section.entries:
        return default
    position = _entry(section, key)[0]
    name = _text(section, key)
    if name.lower() not in known:
        close = closest(name, known)
        hint = f"did you mean {close!r}? " if close else ""
        raise malformed(
            position, f"there is no {key} {name[:40]!r}; {hint}There are {', '.join(known)}"
        )
    return known[name.lower()]


def _check_key(section: Section, key: str, position: Position, known: tuple[str, ...]) -> None:
    if key.lower() not in {each.lower() for each in known}:
        raise malformed(
            position, f"[{section.title}] has no key {key[:40]!r}; there are {', '.join(known)}"
        )


def _check_count(section: Section, key: str, count: int, what: str) -> None:
    if key.lower() in section.entries:
        position, value = _entry(section, key)
        said = value.number("a number")
        value.end()
        if said != count:
            raise malformed(position, f"{key} says {said:.10g}, but there are {count} {what}")
