"""The paper's fuzzy system: from an error and its change to the changes of kp, ki and kd."""

from __future__ import annotations

from collections.abc import Mapping
from math import copysign
from typing import NamedTuple

from jaxtyping import Int

from omnidrive.arrays import Array
from omnidrive.control.pid.rules import LABELS
from omnidrive.fuzzy import (
    And,
    FuzzySet,
    FuzzySystem,
    InputVariable,
    Is,
    Membership,
    OutputVariable,
    Rule,
)

_Triangles = tuple[tuple[float, float, float], ...]

INPUTS = ("error", "derror")
OUTPUTS = ("kp", "ki", "kd")

INPUT_SETS = (
    (-1.0, -1.0, -0.6667),
    (-1.0, -0.6667, 0.0),
    (-1.0, -0.3333, 0.3333),
    (-0.6667, 0.0, 0.6667),
    (-0.3333, 0.3333, 1.0),
    (0.0, 0.6667, 1.0),
    (0.6667, 1.0, 1.0),
)
"""Left foot, peak and right foot of the sets of the scaled error and its scaled change, NB to PB.

Four decimals, as published."""

OUTPUT_SETS = (
    (-0.1, -0.1, -0.06667),
    (-0.1, -0.06667, 0.0),
    (-0.1, -0.03333, 0.03333),
    (-0.06667, 0.0, 0.06667),
    (-0.03333, 0.03333, 0.1),
    (0.0, 0.06667, 0.1),
    (0.06667, 0.1, 0.1),
)
"""The same for the change of each gain."""


_ROUNDING = 1e-3  # of the published points, as a share of the range

SMALL, MEDIUM = 0.3333, 0.6667
"""Published peaks of the small and medium sets, as shares of the range of a variable."""


class Breakpoints(NamedTuple):
    """Peaks of the sets of one variable, as shares of its range; the others are at 0 and 1."""

    small: float = SMALL
    """Peak of the sets NS and PS."""
    medium: float = MEDIUM
    """Peak of the sets NM and PM."""


def gain_tuning_system(
    rules: Int[Array, "7 7 3"], breakpoints: Mapping[str, Breakpoints] | None = None
) -> FuzzySystem:
    """Return the paper's type-1 system with other rules and membership functions.

    Args:
        rules: Rule table of :mod:`omnidrive.control.pid.rules`.
        breakpoints: Peaks of the sets, by variable; published ones for those without any.
    """
    given = breakpoints or {}

    def sets(name: str, triangles: _Triangles) -> tuple[FuzzySet, ...]:
        """Return the sets of a variable."""
        return _sets(_moved(triangles, given.get(name, Breakpoints())))

    return FuzzySystem(
        "gain tuning",
        tuple(InputVariable(name, -1.0, 1.0, sets(name, INPUT_SETS)) for name in INPUTS),
        tuple(OutputVariable(name, -0.1, 0.1, sets(name, OUTPUT_SETS)) for name in OUTPUTS),
        tuple(
            Rule(
                And((Is("error", error), Is("derror", change))),
                tuple(
                    Is(gain, LABELS[k])
                    for gain, k in zip(OUTPUTS, rules[i, j].tolist(), strict=True)
                ),
            )
            for i, error in enumerate(LABELS)
            for j, change in enumerate(LABELS)
        ),
    )


def _moved(triangles: _Triangles, to: Breakpoints) -> _Triangles:
    """Return published triangles whose points at a small or medium peak are moved with it."""
    span = triangles[-1][-1]

    def moved(point: float) -> float:
        """Return the new place of a foot or peak."""
        for published, peak in zip(Breakpoints(), to, strict=True):
            if abs(abs(point) - published * span) < _ROUNDING * span and peak != published:
                return copysign(peak * span, point)
        return point

    return tuple((moved(left), moved(peak), moved(right)) for left, peak, right in triangles)


def _sets(triangles: _Triangles) -> tuple[FuzzySet, ...]:
    return tuple(
        FuzzySet(label, Membership("trimf", triangle))
        for label, triangle in zip(LABELS, triangles, strict=True)
    )
