"""What rules conclude, as the kernels read it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.norms import AGGREGATIONS, IMPLICATIONS
from omnidrive.fuzzy.sets import WHOLE, ZSlice, membership_bounds
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import DEFUZZIFIERS, FuzzySet, LinearFunction


class Shape(NamedTuple):
    """What a rule may conclude about an output: a set, its complement, or a linear function."""

    of: FuzzySet | LinearFunction
    complemented: bool

    def membership_bounds(
        self, at: Float[Array, " points"], plane: ZSlice = WHOLE
    ) -> tuple[Float[Array, " points"], Float[Array, " points"]]:
        """Lower and upper degree at each point, of a fuzzy set."""
        assert isinstance(self.of, FuzzySet)
        (lower,), (upper,) = membership_bounds([self.of], at, plane)
        return (1.0 - upper, 1.0 - lower) if self.complemented else (lower, upper)


class Consequents(NamedTuple):
    """The conclusions of all rules, flat. The shapes of all outputs are numbered in turn."""

    shapes: Int[Array, " rules_by_outputs"]
    """Which shape each rule concludes about each output; -1: it says nothing of it."""
    first_shape: Int[Array, " shape_edges"]
    """Where the shapes of each output begin, and the number of all."""
    implication: Int[Array, " 1"]
    aggregations: Int[Array, " outputs"]
    defuzzifiers: Int[Array, " outputs"]


def consequents_of(system: FuzzySystem) -> tuple[Consequents, tuple[tuple[Shape, ...], ...]]:
    """Conclusions of a system's rules, and the shapes of each output that any rule concludes."""
    shapes = tuple(_shapes(system, output) for output in range(len(system.outputs)))
    first = np.cumsum([0, *map(len, shapes)])
    number = {
        (output.name, shape.of.name, shape.complemented): int(first[o]) + k
        for o, output in enumerate(system.outputs)
        for k, shape in enumerate(shapes[o])
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
        shapes,
    )


def _shapes(system: FuzzySystem, output: int) -> tuple[Shape, ...]:
    variable = system.outputs[output]
    concluded = {
        (term.set, bool(term.hedges))
        for rule in system.rules
        for term in rule.consequents
        if term.variable == variable.name
    }
    return tuple(
        Shape(each, complemented)
        for complemented in (False, True)
        for each in variable.sets
        if (each.name, complemented) in concluded
    )


@compiled
def strongest(
    c: Consequents, strengths: Float[Array, "2 rules"], heights: Float[Array, "2 shapes"]
) -> None:
    """Fill in the least and greatest strength of the strongest rule that concludes each shape."""
    shapes, outputs = c.shapes, len(c.aggregations)
    heights[:] = 0.0
    for r in range(strengths.shape[1]):
        low, high = strengths[0, r], strengths[1, r]
        if high > 0.0:
            for o in range(r * outputs, (r + 1) * outputs):
                k = shapes[o]
                if k >= 0:
                    heights[0, k] = max(heights[0, k], low)
                    heights[1, k] = max(heights[1, k], high)


@compiled
def summed(
    c: Consequents, strengths: Float[Array, "2 rules"], weights: Float[Array, "2 shapes"]
) -> None:
    """Fill in, for each shape, the sums of the least and greatest strengths of its rules.

    Rules with one conclusion have one centroid, so a weighted mean over rules may add up their
    weights first.
    """
    shapes, outputs = c.shapes, len(c.aggregations)
    weights[:] = 0.0
    for r in range(strengths.shape[1]):
        low, high = strengths[0, r], strengths[1, r]
        if high > 0.0:
            for o in range(r * outputs, (r + 1) * outputs):
                k = shapes[o]
                if k >= 0:
                    weights[0, k] += low
                    weights[1, k] += high
