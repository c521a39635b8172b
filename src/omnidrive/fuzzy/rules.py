"""Rules of fuzzy systems: conditions, and what follows from them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.checks import as_floats, check_choice

Hedge = Literal["not", "any", "very", "somewhat", "extremely", "seldom"]
HEDGES: tuple[Hedge, ...] = ("not", "any", "very", "somewhat", "extremely", "seldom")
MAX_DEPTH, MAX_HEDGES = 50, 10


@dataclass(frozen=True, slots=True)
class Is:
    """``variable is [hedges] set``; hedges apply from the right, as in "not very cold".

    Attributes:
        variable: Its name.
        set: Its name; empty after the hedge "any", which takes no set: ``Is("x", "", ("any",))``
            always holds.
        hedges: Left to right; "any" only last.
    """

    variable: str
    set: str
    hedges: tuple[Hedge, ...] = ()

    def __post_init__(self) -> None:
        if len(self.hedges) > MAX_HEDGES:
            raise InvalidInput(f"a set takes at most {MAX_HEDGES} hedges, got {len(self.hedges)}")
        for hedge in self.hedges:
            check_choice("hedge", hedge, HEDGES)
        if "any" in self.hedges[:-1] or (self.hedges[-1:] == ("any",)) != (not self.set):
            raise InvalidInput(
                f"{self.variable!r} is {' '.join((*self.hedges, repr(self.set)))}: a set is "
                "needed, but none after the hedge 'any', which stands last"
            )


@dataclass(frozen=True, slots=True)
class And:
    """All of several conditions, joined by the system's t-norm."""

    parts: tuple[Antecedent, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """Any of several conditions, joined by the system's t-conorm."""

    parts: tuple[Antecedent, ...]


Antecedent = Is | And | Or


@dataclass(frozen=True, slots=True)
class Rule:
    """``if antecedent then consequents``.

    Attributes:
        antecedent: When it fires.
        consequents: One :class:`Is` for each output that it speaks of; the only hedge is "not".
        weight: Factor of its strength, 0 to 1.
    """

    antecedent: Antecedent
    consequents: tuple[Is, ...]
    weight: float = 1.0

    def __post_init__(self) -> None:
        as_floats(self, "weight")
        if not 0.0 <= self.weight <= 1.0:
            raise InvalidInput(f"the weight of a rule must lie in [0, 1], got {self.weight:g}")
        if not self.consequents:
            raise InvalidInput("a rule needs a conclusion")


def propositions(antecedent: Antecedent) -> Iterator[Is]:
    """Every ``variable is set`` in a condition, left to right.

    Raises:
        InvalidInput: The condition is nested too deeply, or a part of it is empty.
    """
    pending: list[tuple[Antecedent, int]] = [(antecedent, 0)]
    while pending:
        each, depth = pending.pop()
        if isinstance(each, Is):
            yield each
            continue
        if depth >= MAX_DEPTH:
            raise InvalidInput(f"a condition is nested more than {MAX_DEPTH} deep")
        if not each.parts:
            raise InvalidInput("a condition joins nothing")
        pending += [(part, depth + 1) for part in reversed(each.parts)]
