"""What a text in the fuzzy control language says, before it becomes a system."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.fuzzy.files.assembly import (
    LocatedRule,
)
from omnidrive.fuzzy.files.fcl_terms import support
from omnidrive.fuzzy.files.fcl_text import Token
from omnidrive.fuzzy.files.polyline import simplest
from omnidrive.fuzzy.files.source import Position, malformed
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction


class Chosen(NamedTuple):
    """Our name of an operator, and where the file names it."""

    name: str
    position: Position


class DeclaredVariable:
    """What the file says of a variable."""

    def __init__(self, name: str, position: Position) -> None:
        self.name = name
        self.position = position
        self.range: tuple[float, float] | None = None
        self.sets: list[FuzzySet | LinearFunction] = []
        self.method: Chosen | None = None
        self.aggregation: Chosen | None = None
        self.default: float | None = None
        self.clips: Position | None = None
        self.drawn: set[str] = set()
        """Names of the sets that are given by points in brackets."""
        self.seen: set[str] = set()

    def once(self, token: Token) -> None:
        """Refuse a statement that was there before."""
        if token.key in self.seen:
            raise malformed(token.position, f"{token.key} is there twice")
        self.seen.add(token.key)

    def fuzzy_sets(self) -> tuple[FuzzySet, ...]:
        """Its sets; points that draw a triangle, a trapezoid or a ramp have become one."""
        fuzzy = (each for each in self.sets if isinstance(each, FuzzySet))
        return tuple(
            FuzzySet(each.name, simplest(each.upper)) if each.name in self.drawn else each
            for each in fuzzy
        )

    def limits(self) -> tuple[float, float]:
        """Its range, or where jFuzzyLogic takes it to be if the file says none."""
        if self.range is not None:
            return self.range
        ends = [support(each) for each in self.sets]
        known = [end for end in ends if end is not None]
        if not known or len(known) < len(ends):
            raise malformed(self.position, f"{self.name[:40]!r}: expected RANGE := (MIN .. MAX)")
        low, high = min(low for low, _ in known), max(high for _, high in known)
        return (low, high) if low < high else (low - 0.5, high + 0.5)


class RuleBlock:
    """What the file says in a RULEBLOCK."""

    def __init__(self, position: Position) -> None:
        self.position = position
        self.operators: dict[str, Chosen] = {}
        self.rules: list[LocatedRule] = []

    def outputs(self) -> set[str]:
        """Names of the outputs that its rules conclude about."""
        return {term.variable for each in self.rules for term in each.rule.consequents}
