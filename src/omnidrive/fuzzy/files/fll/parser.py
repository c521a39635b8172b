"""Syntax tree of a text in the fuzzylite language."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from omnidrive.files.position import Position
from omnidrive.fuzzy.files.fll.lexer import Line, lines
from omnidrive.fuzzy.position import malformed
from omnidrive.fuzzy.system import MAX_VARIABLES

_VARIABLE = frozenset({"description", "enabled", "range", "lock-range", "term"})
KEYS = {
    "Engine": frozenset({"description"}),
    "InputVariable": _VARIABLE,
    "OutputVariable": _VARIABLE
    | {"aggregation", "accumulation", "defuzzifier", "default", "lock-previous", "lock-valid"},
    "RuleBlock": frozenset(
        {
            "description",
            "enabled",
            "conjunction",
            "disjunction",
            "implication",
            "activation",
            "rule",
        }
    ),
}
"""Keys of each component; accumulation and lock-valid are keywords of fuzzylite 5."""


class Component:
    """A heading and the lines below it.

    Attributes:
        kind: Key of the heading, one of :data:`KEYS`.
        position: Position of the heading.
        name: Value of the heading.
        listed: Lines whose key may be repeated: terms or rules.
    """

    def __init__(self, heading: Line) -> None:
        self.kind = heading.key
        self.position = heading.position
        self.name = heading.value
        self.listed: list[Line] = []
        self._fields: dict[str, Line] = {}

    def add(self, line: Line) -> None:
        """Add a line; refuse an unknown or a repeated key."""
        if line.key not in KEYS[self.kind]:
            known = ", ".join(sorted(KEYS[self.kind]))
            raise malformed(
                line.position, f"{self.kind} has no {line.key[:40]!r}: expected one of {known}"
            )
        if line.key in {"term", "rule"}:
            self.listed.append(line)
        elif line.key in self._fields:
            raise malformed(line.position, f"{line.key!r} appears twice")
        else:
            self._fields[line.key] = line

    def get(self, *keys: str) -> Line | None:
        """Return the line of the first key present; None if absent, empty or ``none``."""
        for key in keys:
            line = self._fields.get(key)
            if line is not None and line.value not in {"", "none"}:
                return line
        return None

    def is_true(self, *keys: str, default: bool = False) -> bool:
        """Return the truth value of the first key present."""
        line = self.get(*keys)
        if line is None:
            return default
        if line.value not in {"true", "false"}:
            raise malformed(line.value_position, f"expected true or false, got {line.value[:40]!r}")
        return line.value == "true"

    def check_enabled(self) -> None:
        """Refuse a disabled component."""
        if not self.is_true("enabled", default=True):
            line = self.get("enabled")
            raise malformed(
                line.position if line else None,
                f"a {self.kind} that is not enabled is not supported; remove it",
            )


class FllFile(NamedTuple):
    """Components of a text, by kind."""

    name: str
    """Name of the engine; empty if the text has no Engine."""
    inputs: list[Component]
    outputs: list[Component]
    rule_blocks: list[Component]


def parse(text: str) -> FllFile:
    """Parse a text in the fuzzylite language.

    Raises:
        InvalidFuzzyFile: The syntax is wrong, a key is unknown or repeated, or there are too many
            variables.
    """
    components = list(_components(text))
    by_kind = {kind: [each for each in components if each.kind == kind] for kind in KEYS}
    engines = by_kind["Engine"]
    if len(engines) > 1:
        raise malformed(engines[1].position, "a second Engine: expected one in a file")
    for kind in ("InputVariable", "OutputVariable"):
        if len(by_kind[kind]) > MAX_VARIABLES:
            position = by_kind[kind][MAX_VARIABLES].position
            raise malformed(position, f"more than {MAX_VARIABLES} components {kind}")
    return FllFile(
        engines[0].name if engines else "",
        by_kind["InputVariable"],
        by_kind["OutputVariable"],
        by_kind["RuleBlock"],
    )


def _components(text: str) -> Iterator[Component]:
    component: Component | None = None
    for line in lines(text):
        if line.key in KEYS:
            if component:
                yield component
            component = Component(line)
        elif component is None:
            raise malformed(line.position, f"expected {', '.join(KEYS)}, got {line.key[:40]!r}")
        else:
            component.add(line)
    if component is None:
        raise malformed(Position(1, 1), f"the text is empty: expected {', '.join(KEYS)}")
    yield component
