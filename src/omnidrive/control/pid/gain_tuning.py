"""The paper's fuzzy system: from an error and its change to the changes of kp, ki and kd."""

from __future__ import annotations

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


def gain_tuning_system(rules: Int[Array, "7 7 3"]) -> FuzzySystem:
    """Return the paper's type-1 system with a rule table of :mod:`omnidrive.control.pid.rules`."""
    return FuzzySystem(
        "gain tuning",
        tuple(InputVariable(name, -1.0, 1.0, _sets(INPUT_SETS)) for name in INPUTS),
        tuple(OutputVariable(name, -0.1, 0.1, _sets(OUTPUT_SETS)) for name in OUTPUTS),
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


def _sets(triangles: tuple[tuple[float, float, float], ...]) -> tuple[FuzzySet, ...]:
    return tuple(
        FuzzySet(label, Membership("trimf", triangle))
        for label, triangle in zip(LABELS, triangles, strict=True)
    )
