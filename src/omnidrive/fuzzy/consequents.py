"""Consequents of the rules of a system as flat arrays, and the strengths that fire them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.norms import AGGREGATIONS, IMPLICATIONS
from omnidrive.fuzzy.sets import FULL_FOOTPRINT, ZSlice, membership_bounds
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import DEFUZZIFIERS, FuzzySet, LinearFunction


class Consequent(NamedTuple):
    """Consequent of a rule for one output: a set, its complement, or a linear function."""

    definition: FuzzySet | LinearFunction
    complemented: bool

    def membership_bounds(
        self, at: Float[Array, " points"], z_slice: ZSlice = FULL_FOOTPRINT
    ) -> tuple[Float[Array, " points"], Float[Array, " points"]]:
        """Return the lower and upper degree of membership at each point; for fuzzy sets only."""
        assert isinstance(self.definition, FuzzySet)
        (lower,), (upper,) = membership_bounds([self.definition], at, z_slice)
        return (1.0 - upper, 1.0 - lower) if self.complemented else (lower, upper)


class Consequents(NamedTuple):
    """Consequents of all rules as flat arrays for the kernels.

    The distinct consequents of all outputs are numbered consecutively, output by output.
    """

    indices: Int[Array, " rules_by_outputs"]
    """Number of the consequent of each rule for each output; -1: the rule has none for it."""
    first: Int[Array, " output_edges"]
    """Number of the first consequent of each output, then the total number."""
    implication: Int[Array, " 1"]
    aggregations: Int[Array, " outputs"]
    defuzzifiers: Int[Array, " outputs"]


def consequents_of(system: FuzzySystem) -> tuple[Consequents, tuple[tuple[Consequent, ...], ...]]:
    """Return the consequents of all rules as flat arrays, and the distinct ones per output."""
    consequents = tuple(_consequents(system, output) for output in range(len(system.outputs)))
    first = np.cumsum([0, *map(len, consequents)])
    number = {
        (output.name, consequent.definition.name, consequent.complemented): int(first[o]) + k
        for o, output in enumerate(system.outputs)
        for k, consequent in enumerate(consequents[o])
    }
    table = np.full((len(system.rules), len(system.outputs)), -1)
    column = {output.name: o for o, output in enumerate(system.outputs)}
    for r, rule in enumerate(system.rules):
        for term in rule.consequents:
            named = number[term.variable, term.set, bool(term.hedges)]
            table[r, column[term.variable]] = named
    names = list(DEFUZZIFIERS)
    return (
        Consequents(
            table.ravel(),
            first,
            np.array([IMPLICATIONS[system.implication]]),
            np.array([AGGREGATIONS[output.aggregation] for output in system.outputs]),
            np.array([names.index(str(output.defuzzifier)) for output in system.outputs]),
        ),
        consequents,
    )


def _consequents(system: FuzzySystem, output: int) -> tuple[Consequent, ...]:
    variable = system.outputs[output]
    used = {
        (term.set, bool(term.hedges))
        for rule in system.rules
        for term in rule.consequents
        if term.variable == variable.name
    }
    return tuple(
        Consequent(each, complemented)
        for complemented in (False, True)
        for each in variable.sets
        if (each.name, complemented) in used
    )


@compiled
def max_strengths(
    c: Consequents, strengths: Float[Array, "2 rules"], heights: Float[Array, "2 consequents"]
) -> None:
    """Fill in, per consequent, the greatest lower and upper firing strength of its rules.

    Args:
        c: The consequents.
        strengths: Lower and upper firing strength of each rule.
        heights: Result: height at which each consequent is clipped or scaled, lower and upper.
    """
    indices, outputs = c.indices, len(c.aggregations)
    heights[:] = 0.0
    for r in range(strengths.shape[1]):
        low, high = strengths[0, r], strengths[1, r]
        if high > 0.0:
            for o in range(r * outputs, (r + 1) * outputs):
                k = indices[o]
                if k >= 0:
                    heights[0, k] = max(heights[0, k], low)
                    heights[1, k] = max(heights[1, k], high)


@compiled
def sum_strengths(
    c: Consequents, strengths: Float[Array, "2 rules"], weights: Float[Array, "2 consequents"]
) -> None:
    """Fill in, per consequent, the sums of the lower and the upper firing strengths of its rules.

    Rules with the same consequent have the same centroid, so that a mean weighted by rules equals
    the mean weighted by these sums.

    Args:
        c: The consequents.
        strengths: Lower and upper firing strength of each rule.
        weights: Result: sums of the lower and of the upper strengths.
    """
    indices, outputs = c.indices, len(c.aggregations)
    weights[:] = 0.0
    for r in range(strengths.shape[1]):
        low, high = strengths[0, r], strengths[1, r]
        if high > 0.0:
            for o in range(r * outputs, (r + 1) * outputs):
                k = indices[o]
                if k >= 0:
                    weights[0, k] += low
                    weights[1, k] += high
