"""Fuzzy systems as data: variables with their sets, rules, and the operators that join them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from math import inf, isfinite
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.membership import Array, Curves, Membership, degree
from omnidrive.fuzzy.norms import AGGREGATIONS, CONORMS, IMPLICATIONS, NORMS

Defuzzifier = Literal["centroid", "bisector", "mom", "som", "lom", "lm", "rm", "wtaver", "wtsum"]
Algorithm = Literal["km", "ekm", "eiasc", "iasc", "nie-tan"]
Hedge = Literal["not", "any", "very", "somewhat", "extremely", "seldom"]

DEFUZZIFIERS: dict[str, str] = {
    "centroid": "centre of area",
    "bisector": "line that halves the area",
    "mom": "mean of the maxima",
    "som": "maximum of smallest magnitude (Matlab's)",
    "lom": "maximum of largest magnitude (Matlab's)",
    "lm": "leftmost maximum (IEC 61131-7)",
    "rm": "rightmost maximum (IEC 61131-7)",
    "wtaver": "weighted average (Sugeno)",
    "wtsum": "weighted sum (Sugeno)",
}
ALGORITHMS: tuple[Algorithm, ...] = ("km", "ekm", "eiasc", "iasc", "nie-tan")
HEDGES: tuple[Hedge, ...] = ("not", "any", "very", "somewhat", "extremely", "seldom")

MAX_VARIABLES, MAX_SETS, MAX_RULES, MAX_DEPTH, MAX_HEDGES = 64, 1000, 100_000, 50, 10


@dataclass(frozen=True, slots=True)
class Footprint:
    """How far a lower function lies within its upper one.

    It is ``scale max(0, (upper - lag)/(1 - lag))``.

    On a straight side from a to b the lower function leaves zero at a + lag (b - a), as Matlab's
    LowerScale and LowerLag say. At the middle itself the lesser lag counts.

    Attributes:
        scale: Peak of the lower function over that of the upper one, 0 to 1.
        left: Lag of the left side: degree of the upper function up to which the lower is zero, 0
            to less than 1.
        right: The same for the right side; given as None, it becomes ``left``.
    """

    scale: float = 1.0
    left: float = 0.0
    right: float | None = None

    def __post_init__(self) -> None:
        if self.right is None:
            object.__setattr__(self, "right", self.left)
        if not 0.0 <= self.scale <= 1.0:
            raise InvalidInput(f"a footprint's scale must lie in [0, 1], got {self.scale:g}")
        for lag in self.lags:
            if not 0.0 <= lag < 1.0:
                raise InvalidInput(f"a footprint's lag must lie in [0, 1), got {lag:g}")

    @property
    def lags(self) -> tuple[float, float]:
        """Lags of the left and the right side."""
        return self.left, self.left if self.right is None else self.right


@dataclass(frozen=True, slots=True)
class Secondary:
    """Interval type-2 secondary membership of an interval type-3 set, within its footprint.

    Over the footprint [l, u] at some x, with middle m and standard deviation
    s = spread (u - l)/(2 sqrt 3), that of a uniform distribution where spread = 1 (Castillo, Castro
    & Melin 2022), the upper secondary function is exp(-(v - m)^2 / (2 s^2)), cut at l and u. The
    lower one follows from it by ``scale`` and ``lag``, as a :class:`Footprint` says.

    Attributes:
        spread: Width of the secondary function; ``inf`` makes it 1 on all of [l, u], and the set
            an interval type-2 set.
        scale: Peak of the lower secondary function, 0 to 1.
        lag: Degree of the upper secondary function up to which the lower is zero.
    """

    spread: float = 1.0
    scale: float = 1.0
    lag: float = 0.0

    def __post_init__(self) -> None:
        _as_floats(self, "spread", "scale", "lag")
        if not self.spread > 0.0:
            raise InvalidInput(f"a secondary's spread must be positive, got {self.spread:g}")
        Footprint(self.scale, self.lag)


@dataclass(frozen=True, slots=True)
class FuzzySet:
    """A named set of a variable: type-1, interval type-2 or interval type-3.

    Attributes:
        name: As rules call it.
        upper: Its membership function; the upper one, if there are two.
        lower: What makes it type-2: how the lower function follows from the upper one, or a
            function of its own, which must not exceed the upper one.
        secondary: What makes it type-3.
    """

    name: str
    upper: Membership
    lower: Footprint | Membership | None = None
    secondary: Secondary | None = None

    def __post_init__(self) -> None:
        _check_name("set", self.name)
        if self.secondary is not None and self.lower is None:
            raise InvalidInput(f"set {self.name!r} has a secondary function, but no footprint")


@dataclass(frozen=True, slots=True)
class LinearFunction:
    """Conclusion of a Sugeno rule: ``constant + coefficients . inputs``.

    Attributes:
        name: As rules call it.
        constant: In the unit of the output.
        coefficients: One per input, in the order of the system; empty: a constant.
    """

    name: str
    constant: float
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        _check_name("function", self.name)
        _as_floats(self, "constant")
        object.__setattr__(self, "coefficients", tuple(map(float, self.coefficients)))
        if not all(map(isfinite, (self.constant, *self.coefficients))):
            raise InvalidInput(f"function {self.name!r}: every coefficient must be finite")


@dataclass(frozen=True, slots=True)
class InputVariable:
    """An input: a range and the sets that divide it.

    Attributes:
        name: As rules call it.
        low: Least value.
        high: Greatest value.
        sets: Left to right, by convention.
    """

    name: str
    low: float
    high: float
    sets: tuple[FuzzySet, ...]

    def __post_init__(self) -> None:
        _as_floats(self, "low", "high")
        _check_variable(self.name, self.low, self.high, self.sets)

    def gaps(self) -> list[tuple[float, float]]:
        """Parts of the range that belong to no set: there, a rule may fail to fire.

        Found on 2001 points, so that a gap narrower than 1/2000 of the range may be missed.
        """
        at = np.linspace(self.low, self.high, 2001)
        covered = _covered(Curves.of([each.upper for each in self.sets]), at)
        edges = np.flatnonzero(np.diff(np.r_[False, ~covered, False].astype(np.int64)))
        return [
            (float(at[a]), float(at[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)
        ]


@dataclass(frozen=True, slots=True)
class OutputVariable:
    """An output: of a Mamdani system with fuzzy sets, of a Sugeno system with linear functions.

    Attributes:
        name: As rules call it.
        low: Least value.
        high: Greatest value.
        sets: All fuzzy sets, or all linear functions.
        aggregation: How the conclusions of several rules are joined; a name of
            :data:`~omnidrive.fuzzy.norms.AGGREGATIONS`. That of a Sugeno system is always a sum.
        defuzzifier: How one number is made of it; None: centroid, or weighted average (Sugeno).
        default: Value where no rule fires; None: the middle of the range.
    """

    name: str
    low: float
    high: float
    sets: tuple[FuzzySet, ...] | tuple[LinearFunction, ...]
    aggregation: str = "max"
    defuzzifier: Defuzzifier | None = None
    default: float | None = None

    def __post_init__(self) -> None:
        _as_floats(self, "low", "high", "default")
        _check_variable(self.name, self.low, self.high, self.sets)
        kinds = {type(each) for each in self.sets}
        if len(kinds) > 1:
            raise InvalidInput(f"output {self.name!r} mixes fuzzy sets and linear functions")
        if self.defuzzifier is None:
            usual: Defuzzifier = "wtaver" if self.is_sugeno else "centroid"
            object.__setattr__(self, "defuzzifier", usual)
        _check_choice("defuzzifier", str(self.defuzzifier), DEFUZZIFIERS)
        _check_choice("aggregation", self.aggregation, AGGREGATIONS)
        if (self.defuzzifier in {"wtaver", "wtsum"}) != self.is_sugeno:
            made_of = "linear functions" if self.is_sugeno else "fuzzy sets"
            raise InvalidInput(
                f"output {self.name!r} is made of {made_of}: {self.defuzzifier} cannot defuzzify it"
            )
        if self.is_sugeno:
            object.__setattr__(self, "aggregation", "sum")
        if self.default is not None and not isfinite(self.default):
            raise InvalidInput(f"output {self.name!r}: the default must be finite")

    @property
    def is_sugeno(self) -> bool:
        """Whether its conclusions are linear functions."""
        return any(isinstance(each, LinearFunction) for each in self.sets)

    @property
    def fallback(self) -> float:
        """Value where no rule fires."""
        return 0.5 * (self.low + self.high) if self.default is None else self.default


Variable = InputVariable | OutputVariable


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
            _check_choice("hedge", hedge, HEDGES)
        if "any" in self.hedges[:-1] or (self.hedges[-1:] == ("any",)) != (not self.set):
            raise InvalidInput(
                f"{self.variable!r} is {' '.join((*self.hedges, repr(self.set)))}: a set is "
                "needed, but none after the hedge 'any', which stands last"
            )


@dataclass(frozen=True, slots=True)
class And:
    """All of several conditions, joined by the system's t-norm."""

    parts: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """Any of several conditions, joined by the system's t-conorm."""

    parts: tuple[Condition, ...]


Condition = Is | And | Or


@dataclass(frozen=True, slots=True)
class Rule:
    """``if condition then conclusions``.

    Attributes:
        condition: When it fires.
        conclusions: One :class:`Is` for each output that it speaks of; the only hedge is "not".
        weight: Factor of its strength, 0 to 1.
    """

    condition: Condition
    conclusions: tuple[Is, ...]
    weight: float = 1.0

    def __post_init__(self) -> None:
        _as_floats(self, "weight")
        if not 0.0 <= self.weight <= 1.0:
            raise InvalidInput(f"the weight of a rule must lie in [0, 1], got {self.weight:g}")
        if not self.conclusions:
            raise InvalidInput("a rule needs a conclusion")


@dataclass(frozen=True, slots=True)
class FuzzySystem:
    """A Mamdani or Sugeno system of type 1, interval type 2 or interval type 3.

    Attributes:
        name: Of the system.
        inputs: In the order in which values are given.
        outputs: In the order in which values are returned.
        rules: All of them count; their order does not.
        conjunction: What "and" does; a name of :data:`~omnidrive.fuzzy.norms.NORMS`.
        disjunction: What "or" does; a name of :data:`~omnidrive.fuzzy.norms.CONORMS`.
        implication: How a rule's strength shapes its conclusion: min cuts it, prod scales it.
        algorithm: Type reduction of a type-2 or type-3 system.

    Raises:
        InvalidInput: A name is missing, double or unknown, or an operator is unknown.
    """

    name: str
    inputs: tuple[InputVariable, ...]
    outputs: tuple[OutputVariable, ...]
    rules: tuple[Rule, ...]
    conjunction: str = "min"
    disjunction: str = "max"
    implication: str = "min"
    algorithm: Algorithm = "km"

    def __post_init__(self) -> None:
        for what, variables in (("input", self.inputs), ("output", self.outputs)):
            if not 1 <= len(variables) <= MAX_VARIABLES:
                raise InvalidInput(
                    f"a fuzzy system needs 1 to {MAX_VARIABLES} {what}s, got {len(variables)}"
                )
        _check_different("variables", [v.name for v in self.variables])
        _check_choice("conjunction", self.conjunction, NORMS)
        _check_choice("disjunction", self.disjunction, CONORMS)
        _check_choice("implication", self.implication, IMPLICATIONS)
        _check_choice("type reduction", self.algorithm, ALGORITHMS)
        if len({v.is_sugeno for v in self.outputs}) > 1:
            raise InvalidInput("one output is made of fuzzy sets, another of linear functions")
        for output in self.outputs:
            for each in output.sets:
                wanted = len(self.inputs)
                if isinstance(each, LinearFunction) and len(each.coefficients) not in {0, wanted}:
                    raise InvalidInput(
                        f"function {each.name!r} of {output.name!r} needs {wanted} coefficients, "
                        f"one per input, or none, got {len(each.coefficients)}"
                    )
        if not 1 <= len(self.rules) <= MAX_RULES:
            raise InvalidInput(
                f"a fuzzy system needs 1 to {MAX_RULES} rules, got {len(self.rules)}"
            )
        sets_of = {v.name: {each.name for each in v.sets} for v in self.variables}
        inputs = tuple(v.name for v in self.inputs)
        outputs = tuple(v.name for v in self.outputs)
        for number, rule in enumerate(self.rules, 1):
            for term in terms(rule.condition):
                _check_term(number, "input", term, inputs, sets_of)
            for term in rule.conclusions:
                _check_term(number, "output", term, outputs, sets_of)
                if term.hedges not in {(), ("not",)} or (term.hedges and self.is_sugeno):
                    raise InvalidInput(
                        f"rule {number}: a conclusion cannot be {' '.join(term.hedges)!r}"
                    )
            if len({term.variable for term in rule.conclusions}) < len(rule.conclusions):
                raise InvalidInput(f"rule {number} concludes twice about one output")

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Inputs, then outputs."""
        return (*self.inputs, *self.outputs)

    @property
    def is_sugeno(self) -> bool:
        """Whether conclusions are linear functions (Takagi, Sugeno & Kang), not sets (Mamdani)."""
        return self.outputs[0].is_sugeno

    @property
    def type(self) -> int:
        """1, 2 or 3: the greatest type of any of its sets."""
        sets = [s for v in self.variables for s in v.sets if isinstance(s, FuzzySet)]
        if any(s.secondary is not None for s in sets):
            return 3
        return 2 if any(s.lower is not None for s in sets) else 1

    def with_footprint(
        self,
        inputs: Footprint,
        outputs: Footprint | None = None,
        secondary: Secondary | None = None,
    ) -> FuzzySystem:
        """The system with every set uncertain: of type 2, or of type 3 with a secondary.

        Args:
            inputs: Footprint of every set of an input.
            outputs: Footprint of every set of an output; None: as the inputs'.
            secondary: Of every set.
        """
        outputs = inputs if outputs is None else outputs

        def uncertain(each: FuzzySet, footprint: Footprint) -> FuzzySet:
            return replace(each, lower=footprint, secondary=secondary)

        return replace(
            self,
            inputs=tuple(
                replace(v, sets=tuple(uncertain(s, inputs) for s in v.sets)) for v in self.inputs
            ),
            outputs=tuple(
                v
                if v.is_sugeno
                else replace(
                    v, sets=tuple(uncertain(s, outputs) for s in v.sets if isinstance(s, FuzzySet))
                )
                for v in self.outputs
            ),
        )

    def without_secondary(self) -> FuzzySystem:
        """The system of type 2 with the same footprints."""

        def plain(sets: Sequence[FuzzySet | LinearFunction]) -> tuple[FuzzySet, ...]:
            return tuple(replace(s, secondary=None) for s in sets if isinstance(s, FuzzySet))

        return replace(
            self,
            inputs=tuple(replace(v, sets=plain(v.sets)) for v in self.inputs),
            outputs=tuple(
                v if v.is_sugeno else replace(v, sets=plain(v.sets)) for v in self.outputs
            ),
        )


def terms(condition: Condition) -> Iterator[Is]:
    """Every ``variable is set`` in a condition, left to right.

    Raises:
        InvalidInput: The condition is nested too deeply, or a part of it is empty.
    """
    pending: list[tuple[Condition, int]] = [(condition, 0)]
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


def nearest(name: str, known: Sequence[str]) -> str:
    """``; did you mean ...?`` or a list of what there is: the end of an error message."""
    close = get_close_matches(name, known, n=1) or [k for k in known if k.lower() == name.lower()]
    if close:
        return f"; did you mean {close[0]!r}?"
    shown = ", ".join(known[:12])
    return f"; there are {shown}{', ...' if len(known) > 12 else ''}"


def _as_floats(value: object, *fields: str) -> None:
    """Make floats of the integers that a user may have written."""
    for field in fields:
        given = getattr(value, field)
        if given is not None:
            object.__setattr__(value, field, float(given))


@compiled
def _covered(curves: Curves, at: Float[Array, " points"]) -> Bool[Array, " points"]:
    """Whether each point belongs to any set."""
    covered = np.zeros(len(at), dtype=np.bool_)
    for i, x in enumerate(at):
        for k in range(len(curves.kernels)):
            if degree(curves, k, x) > 0.0:
                covered[i] = True
                break
    return covered


def _check_term(
    number: int, what: str, term: Is, variables: tuple[str, ...], sets_of: dict[str, set[str]]
) -> None:
    if term.variable not in variables:
        hint = nearest(term.variable, variables)
        raise InvalidInput(f"rule {number}: there is no {what} {term.variable!r}{hint}")
    if term.set and term.set not in sets_of[term.variable]:
        known = sorted(sets_of[term.variable])
        raise InvalidInput(
            f"rule {number}: {term.variable!r} has no set {term.set!r}{nearest(term.set, known)}"
        )


def _check_name(what: str, name: str) -> None:
    if not name or len(name) > 200 or not name.isprintable() or name != name.strip():
        raise InvalidInput(
            f"the name of a {what} must be 1 to 200 printable characters: {name[:40]!r}"
        )


def _check_variable(
    name: str, low: float, high: float, sets: Sequence[FuzzySet | LinearFunction]
) -> None:
    _check_name("variable", name)
    if not (isfinite(low) and isfinite(high) and low < high and high - low < inf):
        raise InvalidInput(f"the range of {name!r} must have a width, got [{low:g}, {high:g}]")
    if not 1 <= len(sets) <= MAX_SETS:
        raise InvalidInput(f"{name!r} needs 1 to {MAX_SETS} sets, got {len(sets)}")
    _check_different(f"sets of {name!r}", [each.name for each in sets])


def _check_different(what: str, names: list[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InvalidInput(f"{what}: the name {name!r} is there twice")
        seen.add(name)


def _check_choice(
    what: str, name: str, known: Sequence[str] | dict[str, str] | dict[str, int]
) -> None:
    if name not in known:
        raise InvalidInput(f"there is no {what} {name!r}{nearest(name, tuple(known))}")
