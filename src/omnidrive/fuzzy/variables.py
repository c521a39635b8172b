"""Variables of fuzzy systems, their sets, and the footprints of uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.checks import check_name, check_numbers, check_unique, convert_to_floats
from omnidrive.fuzzy.membership import Curves, Membership, degree
from omnidrive.fuzzy.norms import AGGREGATIONS
from omnidrive.parameter import check_choice

Defuzzifier = Literal["centroid", "bisector", "mom", "som", "lom", "lm", "rm", "wtaver", "wtsum"]
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
MAX_SETS = 1000


@dataclass(frozen=True, slots=True)
class Footprint:
    """Footprint of uncertainty: lower function ``scale max(0, (upper - lag)/(1 - lag))``.

    On a straight side from a to b, the lower function leaves zero at a + lag (b - a), as Matlab's
    LowerScale and LowerLag define it. At the midpoint of the core, the lesser lag applies.

    Attributes:
        scale: Peak of the lower function over that of the upper one, 0 to 1.
        left: Lag of the left side: degree of the upper function up to which the lower one is zero,
            0 to less than 1.
        right: Lag of the right side; None is replaced by ``left``.
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

    Over the footprint [l, u] at some x, with midpoint m and standard deviation
    s = spread (u - l)/(2 sqrt 3), that of a uniform distribution if spread = 1 (Castillo, Castro
    & Melin 2022), the upper secondary function is exp(-(v - m)^2 / (2 s^2)), truncated at l and u.
    The lower one follows from it by ``scale`` and ``lag`` as in :class:`Footprint`.

    Attributes:
        spread: Width of the secondary function; ``inf`` makes it 1 on all of [l, u], and the set
            an interval type-2 set.
        scale: Peak of the lower secondary function, 0 to 1.
        lag: Degree of the upper secondary function up to which the lower one is zero.
    """

    spread: float = 1.0
    scale: float = 1.0
    lag: float = 0.0

    def __post_init__(self) -> None:
        convert_to_floats(self, "spread", "scale", "lag")
        if not self.spread > 0.0:
            raise InvalidInput(f"a secondary's spread must be positive, got {self.spread:g}")
        Footprint(self.scale, self.lag)


@dataclass(frozen=True, slots=True)
class FuzzySet:
    """A named set of a variable: type 1, interval type 2 or interval type 3.

    Attributes:
        name: Name that rules refer to.
        upper: Membership function; the upper one of a type-2 or type-3 set.
        lower: Lower function of a type-2 or type-3 set: a footprint, by which it follows from the
            upper one, or a function of its own, which must not exceed the upper one. None: type 1.
        secondary: Secondary membership of a type-3 set; None: type 1 or 2.
    """

    name: str
    upper: Membership
    lower: Footprint | Membership | None = None
    secondary: Secondary | None = None

    def __post_init__(self) -> None:
        check_name("set", self.name)
        if self.secondary is not None and self.lower is None:
            raise InvalidInput(f"set {self.name!r} has a secondary function but no footprint")


@dataclass(frozen=True, slots=True)
class LinearFunction:
    """Consequent of a Sugeno rule: ``constant + coefficients . inputs``.

    Attributes:
        name: Name that rules refer to.
        constant: Constant term, in the unit of the output.
        coefficients: One per input, in the order of the system; empty: the function is constant.
    """

    name: str
    constant: float
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check_name("function", self.name)
        convert_to_floats(self, "constant")
        object.__setattr__(self, "coefficients", tuple(map(float, self.coefficients)))
        check_numbers(f"function {self.name!r}", self.constant, *self.coefficients)


@dataclass(frozen=True, slots=True)
class InputVariable:
    """An input: a range and the sets over it.

    Attributes:
        name: Name that rules refer to.
        low: Least value.
        high: Greatest value.
        sets: Fuzzy sets, by convention from left to right; empty for an input of linear
            functions only, or of no rule.
    """

    name: str
    low: float
    high: float
    sets: tuple[FuzzySet, ...]

    def __post_init__(self) -> None:
        convert_to_floats(self, "low", "high")
        _check_variable(self.name, self.low, self.high, self.sets, 0)

    def gaps(self) -> list[tuple[float, float]]:
        """Return the intervals of the range that belong to no set, where rules may fail to fire.

        An input without sets has none. Evaluated at 2001 points: a gap narrower than 1/2000 of the
        range may be missed.
        """
        if not self.sets:
            return []
        at = np.linspace(self.low, self.high, 2001)
        covered = _covered(Curves.of([each.upper for each in self.sets]), at)
        edges = np.flatnonzero(np.diff(np.r_[False, ~covered, False].astype(np.int64)))
        return [
            (float(at[a]), float(at[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)
        ]


@dataclass(frozen=True, slots=True)
class OutputVariable:
    """An output: with fuzzy sets in a Mamdani system, with linear functions in a Sugeno system.

    Attributes:
        name: Name that rules refer to.
        low: Least value.
        high: Greatest value.
        sets: Either fuzzy sets or linear functions.
        aggregation: Operator that aggregates the consequents of the rules; a name of
            :data:`~omnidrive.fuzzy.norms.AGGREGATIONS`. Always the sum in a Sugeno system.
        defuzzifier: A name of :data:`DEFUZZIFIERS`; None: centroid, or weighted average (Sugeno).
        default: Value if no rule fires; None: the middle of the range.
    """

    name: str
    low: float
    high: float
    sets: tuple[FuzzySet, ...] | tuple[LinearFunction, ...]
    aggregation: str = "max"
    defuzzifier: Defuzzifier | None = None
    default: float | None = None

    def __post_init__(self) -> None:
        convert_to_floats(self, "low", "high", "default")
        _check_variable(self.name, self.low, self.high, self.sets, 1)
        kinds = {type(each) for each in self.sets}
        if len(kinds) > 1:
            raise InvalidInput(f"output {self.name!r} mixes fuzzy sets and linear functions")
        if self.defuzzifier is None:
            default: Defuzzifier = "wtaver" if self.is_sugeno else "centroid"
            object.__setattr__(self, "defuzzifier", default)
        check_choice("defuzzifier", str(self.defuzzifier), DEFUZZIFIERS)
        check_choice("aggregation", self.aggregation, AGGREGATIONS)
        if (self.defuzzifier in {"wtaver", "wtsum"}) != self.is_sugeno:
            kind = "linear functions" if self.is_sugeno else "fuzzy sets"
            raise InvalidInput(
                f"output {self.name!r} is made of {kind}: {self.defuzzifier} cannot defuzzify it"
            )
        if self.is_sugeno:
            object.__setattr__(self, "aggregation", "sum")
        if self.default is not None:
            check_numbers(f"the default of {self.name!r}", self.default)

    @property
    def is_sugeno(self) -> bool:
        """Whether its consequents are linear functions."""
        return any(isinstance(each, LinearFunction) for each in self.sets)

    @property
    def fallback(self) -> float:
        """Value if no rule fires."""
        return 0.5 * (self.low + self.high) if self.default is None else self.default


Variable = InputVariable | OutputVariable


@compiled
def _covered(curves: Curves, at: Float[Array, " points"]) -> Bool[Array, " points"]:
    """Return whether each point belongs to any set."""
    covered = np.zeros(len(at), dtype=np.bool_)
    for i, x in enumerate(at):
        for k in range(len(curves.kernels)):
            if degree(curves, k, x) > 0.0:
                covered[i] = True
                break
    return covered


def _check_variable(
    name: str, low: float, high: float, sets: Sequence[FuzzySet | LinearFunction], minimum: int
) -> None:
    check_name("variable", name)
    check_numbers(f"the range of {name!r}", low, high)
    if not low < high:
        raise InvalidInput(f"the range of {name!r} must have a width, got [{low:g}, {high:g}]")
    if not minimum <= len(sets) <= MAX_SETS:
        raise InvalidInput(f"{name!r} needs {minimum} to {MAX_SETS} sets, got {len(sets)}")
    check_unique(f"sets of {name!r}", [each.name for each in sets])
