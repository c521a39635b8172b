"""Syntax tree of a ``.fis`` file."""

from __future__ import annotations

import re
from typing import NamedTuple

from omnidrive.files.position import Position
from omnidrive.fuzzy.files.fis.lexer import Cursor, code_lines
from omnidrive.fuzzy.position import LocatedText, malformed
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES
from omnidrive.fuzzy.variables import MAX_SETS

_SECTION = re.compile(r"\s*\[([A-Za-z]+)\s*(?:(\d+)\s*)?\]\s*")
_ENTRY = re.compile(r"\s*([A-Za-z]\w*)\s*=\s*")
_SET_KEY = re.compile(r"(?i:mf)(\d{1,9})")
_MAX_LINES = {"rules": MAX_RULES, "input": 2 * MAX_SETS, "output": 2 * MAX_SETS, "system": 50}

_OPTIONS = (
    *("Name", "Type", "AndMethod", "OrMethod", "ImpMethod", "AggMethod", "DefuzzMethod"),
    "TypeReductionMethod",
)
"""Keys of [System] whose values are quoted texts."""

_SYSTEM_KEYS = (*_OPTIONS, "Version", "NumInputs", "NumOutputs", "NumRules")


class SystemEntry(NamedTuple):
    """Section [System]."""

    position: Position
    options: dict[str, LocatedText]
    """Texts by their keys, in lower case; absent keys are missing."""


class SetEntry(NamedTuple):
    """A line ``MFk='name':'shape',[parameters],[LowerScale],[LowerLag]``."""

    name: str
    position: Position
    shape: LocatedText
    parameters: tuple[float, ...]
    footprint: tuple[tuple[float, ...], ...]
    """LowerScale and LowerLag, as far as the line has them."""
    footprint_position: Position


class VariableEntry(NamedTuple):
    """Section [Inputk] or [Outputk]."""

    position: Position
    name: LocatedText
    low: float
    high: float
    sets: tuple[SetEntry, ...]


class RuleEntry(NamedTuple):
    """A line ``1 -2, 1 (0.5) : 1`` of [Rules]."""

    inputs: tuple[LocatedText, ...]
    """Number of a set of each input."""
    outputs: tuple[LocatedText, ...]
    """Number of a set of each output."""
    weight: float
    weight_position: Position
    is_or: bool
    """Whether the connective is 2 (or), not 1 (and)."""


class FisFile(NamedTuple):
    """All sections."""

    system: SystemEntry
    inputs: tuple[VariableEntry, ...]
    outputs: tuple[VariableEntry, ...]
    rules: tuple[RuleEntry, ...]


class _Section(NamedTuple):
    title: str
    """As in ``Input1``."""
    position: Position
    entries: dict[str, tuple[str, Position, Cursor]]
    """Key as written, its position, and the value, by the key in lower case."""
    lines: list[Cursor]
    """Lines of [Rules], which has no entries."""


def parse(text: str) -> FisFile:
    """Parse the text of a ``.fis`` file.

    Keys and headings are accepted in any case.

    Raises:
        InvalidFuzzyFile: The syntax is wrong, a section, key or line is unknown, missing or
            repeated, or a count (NumInputs, NumMFs, ...) is wrong.
    """
    sections = _sections(text)
    head = sections.get(("system", 0))
    if head is None:
        raise malformed(Position(1, 1), "expected [System], which is missing")
    for key, position, _ in head.entries.values():
        _check_key(head, key, position, _SYSTEM_KEYS)
    keys = [key for key in _OPTIONS if key.lower() in head.entries]
    options = {key.lower(): _text(head, key) for key in keys}
    inputs = _variables(sections, head, "input")
    outputs = _variables(sections, head, "output")
    rules = _rules(sections, head, inputs, outputs)
    return FisFile(SystemEntry(head.position, options), inputs, outputs, rules)


def _sections(text: str) -> dict[tuple[str, int], _Section]:
    """Return the sections by their kind, in lower case, and their number (0: none)."""
    found: dict[tuple[str, int], _Section] = {}
    section: _Section | None = None
    kind = ""
    for row, line in code_lines(text):
        heading = _SECTION.fullmatch(line)
        if heading is not None:
            position = Cursor(line, row).position
            kind, index = _heading(heading, Cursor(line, row))
            if (kind, index) in found:
                raise malformed(position, f"{line.strip()} appears twice")
            title = heading[1] + (heading[2] or "")
            section = found[kind, index] = _Section(title, position, {}, [])
            continue
        if section is None:
            Cursor(line, row).fail("[System]")
        if len(section.entries) + len(section.lines) >= _MAX_LINES[kind]:
            raise malformed(
                Position(row, 1), f"[{section.title}] has more than {_MAX_LINES[kind]} lines"
            )
        if kind == "rules":
            section.lines.append(Cursor(line, row))
        else:
            _add_entry(section, line, row)
    return found


def _heading(heading: re.Match[str], cursor: Cursor) -> tuple[str, int]:
    kind, digits = heading[1].lower(), heading[2] or ""
    numbered = kind in {"input", "output"}
    if kind not in _MAX_LINES or numbered != bool(digits):
        cursor.fail("[System], [Input1], ..., [Output1], ..., or [Rules]")
    if numbered and not (len(digits) <= 9 and 1 <= int(digits) <= MAX_VARIABLES):
        cursor.fail(f"at most [{heading[1]}{MAX_VARIABLES}]")
    return kind, int(digits or 0)


def _add_entry(section: _Section, line: str, row: int) -> None:
    start = Cursor(line, row)
    entry = _ENTRY.match(line)
    if entry is None:
        start.fail("'Key=value' or a [Section]")
    key = entry[1]
    if key.lower() in section.entries:
        raise malformed(start.position, f"{key[:40]} appears twice in [{section.title}]")
    section.entries[key.lower()] = key, start.position, Cursor(line, row, entry.end())


def _variables(
    sections: dict[tuple[str, int], _Section], head: _Section, kind: str
) -> tuple[VariableEntry, ...]:
    found = sorted((index, each) for (other, index), each in sections.items() if other == kind)
    title = kind.capitalize()
    for expected, (index, section) in enumerate(found, 1):
        if index != expected:
            raise malformed(
                section.position, f"expected [{title}{expected}] first, got [{section.title}]"
            )
    _check_count(head, f"Num{title}s", len(found), f"[{title}] sections")
    if not found:
        raise malformed(head.position, f"expected a section [{title}1]")
    return tuple(_variable(section) for _, section in found)


def _variable(section: _Section) -> VariableEntry:
    sets = _sets(section)
    name = _text(section, "Name")
    value = _value(section, "Range")
    position = value.position
    limits = value.numbers("the range [low high]")
    value.end()
    if len(limits) != 2 or not limits[0] < limits[1]:
        shown = " ".join(f"{each:g}" for each in limits[:4])
        raise malformed(position, f"expected Range=[low high] with low < high, got [{shown}]")
    return VariableEntry(section.position, name, limits[0], limits[1], sets)


def _sets(section: _Section) -> tuple[SetEntry, ...]:
    found: dict[int, SetEntry] = {}
    for key, position, value in section.entries.values():
        match = _SET_KEY.fullmatch(key)
        if match is None:
            _check_key(section, key, position, ("Name", "Range", "NumMFs", "MF1, MF2, ..."))
            continue
        if int(match[1]) in found:
            raise malformed(position, f"MF{int(match[1])} appears twice in [{section.title}]")
        found[int(match[1])] = _set(key, position, value)
    for expected, index in enumerate(sorted(found), 1):
        if index != expected:
            raise malformed(found[index].position, f"expected MF{expected} first, got MF{index}")
    _check_count(section, "NumMFs", len(found), "sets")
    return tuple(found[index] for index in sorted(found))


def _set(key: str, position: Position, value: Cursor) -> SetEntry:
    name = value.quoted(f"the name of {key}")
    value.expect(":", "after the name")
    shape_position = value.position
    shape = LocatedText(value.quoted("a membership function"), shape_position)
    value.expect(",", "after the function")
    parameters = value.numbers("parameters")
    footprint_position = value.position
    footprint: list[tuple[float, ...]] = []
    while len(footprint) < 2 and value.accept(","):
        at = value.position
        footprint.append(value.numbers(("LowerScale", "LowerLag")[len(footprint)]))
        if len(footprint[-1]) not in {1, len(footprint)}:
            expected = ("LowerScale: one number", "LowerLag: one number or two")[len(footprint) - 1]
            raise malformed(at, f"expected {expected}, got {len(footprint[-1])}")
    value.end()
    return SetEntry(name, position, shape, parameters, tuple(footprint), footprint_position)


def _rules(
    sections: dict[tuple[str, int], _Section],
    head: _Section,
    inputs: tuple[VariableEntry, ...],
    outputs: tuple[VariableEntry, ...],
) -> tuple[RuleEntry, ...]:
    section = sections.get(("rules", 0))
    if section is None:
        raise malformed(head.position, "expected a section [Rules]")
    _check_count(head, "NumRules", len(section.lines), "lines in [Rules]")
    if not section.lines:
        raise malformed(section.position, "expected a rule in [Rules], got none")
    expected = [f"the number of a set of {each.name.text!r}" for each in (*inputs, *outputs)]
    split = len(inputs)
    return tuple(_rule(line, expected[:split], expected[split:]) for line in section.lines)


def _rule(line: Cursor, inputs: list[str], outputs: list[str]) -> RuleEntry:
    """Parse a rule; ``inputs`` and ``outputs`` describe the expected numbers in messages."""
    antecedent = tuple(_token(line, each) for each in inputs)
    line.expect(",", f"after the numbers of {len(inputs)} sets, one per input")
    consequent = tuple(_token(line, each) for each in outputs)
    line.expect("(", f"before the weight, after the numbers of {len(outputs)} sets, one per output")
    weight_position = line.position
    weight = line.number("a weight")
    line.expect(")", "after the weight")
    line.expect(":", "after the weight")
    connective_position = line.position
    connective = line.number("1 (and) or 2 (or)")
    line.end()
    if connective not in {1.0, 2.0}:
        raise malformed(connective_position, f"expected 1 (and) or 2 (or), got {connective:g}")
    return RuleEntry(antecedent, consequent, weight, weight_position, connective == 2.0)


def _token(line: Cursor, what: str) -> LocatedText:
    position = line.position
    return LocatedText(line.word(what), position)


def _value(section: _Section, key: str) -> Cursor:
    if key.lower() not in section.entries:
        raise malformed(section.position, f"expected {key}=... in [{section.title}]")
    return section.entries[key.lower()][2]


def _text(section: _Section, key: str) -> LocatedText:
    value = _value(section, key)
    position = value.position
    text = value.quoted(f"the {key.lower()}")
    value.end()
    return LocatedText(text, position)


def _check_key(section: _Section, key: str, position: Position, known: tuple[str, ...]) -> None:
    if key.lower() not in {each.lower() for each in known}:
        raise malformed(
            position, f"[{section.title}] has no key {key[:40]!r}; there are {', '.join(known)}"
        )


def _check_count(section: _Section, key: str, count: int, what: str) -> None:
    if key.lower() in section.entries:
        value = _value(section, key)
        position = value.position
        declared = value.number("a number")
        value.end()
        if declared != count:
            raise malformed(position, f"{key} is {declared:.10g}, but there are {count} {what}")
