"""Rules of fuzzy systems: antecedents, consequents and weights."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.checks import convert_to_floats
from omnidrive.parameter import check_choice

Hedge = Literal["not", "any", "very", "somewhat", "extremely", "seldom"]
HEDGES: tuple[Hedge, ...] = ("not", "any", "very", "somewhat", "extremely", "seldom")
MAX_DEPTH, MAX_HEDGES = 50, 10


@dataclass(frozen=True, slots=True)
class Is:
    """The proposition ``variable is [hedges] set``; hedges apply from the right: "not very cold".

    Attributes:
        variable: Name of the variable.
        set: Name of the set; empty after the hedge "any", which takes no set:
            ``Is("x", "", ("any",))`` is always true.
        hedges: From left to right; "any" must be the last one.
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
                "required, except after the hedge 'any', which must be the last one"
            )

    def hedged(self, hedges: tuple[Hedge, ...]) -> Is:
        """Return the proposition with ``hedges`` before its own."""
        return Is(self.variable, self.set, hedges + self.hedges)


@dataclass(frozen=True, slots=True)
class And:
    """Conjunction of antecedents by the system's t-norm."""

    parts: tuple[Antecedent, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """Disjunction of antecedents by the system's t-conorm."""

    parts: tuple[Antecedent, ...]


Antecedent = Is | And | Or


@dataclass(frozen=True, slots=True)
class Rule:
    """``if antecedent then consequents``.

    Attributes:
        antecedent: A proposition, or a conjunction or disjunction of antecedents.
        consequents: One :class:`Is` per output; the only possible hedge is "not".
        weight: Factor of the firing strength, 0 to 1.
    """

    antecedent: Antecedent
    consequents: tuple[Is, ...]
    weight: float = 1.0

    def __post_init__(self) -> None:
        convert_to_floats(self, "weight")
        if not 0.0 <= self.weight <= 1.0:
            raise InvalidInput(f"the weight of a rule must lie in [0, 1], got {self.weight:g}")
        if not self.consequents:
            raise InvalidInput("a rule needs a consequent")


def negated(antecedent: Antecedent) -> Antecedent:
    """Return the complement of an antecedent by De Morgan's laws.

    It equals 1 minus the degree of the antecedent if "or" is the dual of "and".
    """
    if isinstance(antecedent, Is):
        if antecedent.hedges[:1] == ("not",):
            return Is(antecedent.variable, antecedent.set, antecedent.hedges[1:])
        return antecedent.hedged(("not",))
    parts = tuple(map(negated, antecedent.parts))
    return Or(parts) if isinstance(antecedent, And) else And(parts)


def propositions(antecedent: Antecedent) -> Iterator[Is]:
    """Yield every proposition of an antecedent from left to right.

    Raises:
        InvalidInput: The antecedent is nested too deeply, or a part of it is empty.
    """
    pending: list[tuple[Antecedent, int]] = [(antecedent, 0)]
    while pending:
        each, depth = pending.pop()
        if isinstance(each, Is):
            yield each
            continue
        if depth >= MAX_DEPTH:
            raise InvalidInput(f"an antecedent is nested more than {MAX_DEPTH} deep")
        if not each.parts:
            raise InvalidInput("a conjunction or disjunction in an antecedent has no parts")
        pending += [(part, depth + 1) for part in reversed(each.parts)]
