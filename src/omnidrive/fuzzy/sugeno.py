"""Sugeno inference: weighted means and sums of linear functions of the inputs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.consequents import Consequent
from omnidrive.fuzzy.reduction import type_reduce
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import LinearFunction


class FlatFunctions(NamedTuple):
    """Linear functions of all consequents as a flat array."""

    coefficients: Float[Array, " coefficients"]
    """Per function: one coefficient per input, then the constant."""


def flatten_functions(
    system: FuzzySystem, consequents: tuple[tuple[Consequent, ...], ...]
) -> FlatFunctions:
    """Return the linear functions of all outputs as a flat array."""
    rows: list[float] = []
    for own in consequents:
        for consequent in own:
            assert isinstance(consequent.definition, LinearFunction)
            rows += consequent.definition.coefficients or (0.0,) * len(system.inputs)
            rows.append(consequent.definition.constant)
    return FlatFunctions(np.array(rows))


@compiled
def sugeno_interval(  # noqa: PLR0917
    s: FlatFunctions,
    first: int,
    is_sum: bool,
    algorithm: int,
    x: Float[Array, " inputs"],
    lower: Float[Array, " functions"],
    upper: Float[Array, " functions"],
) -> tuple[float, float]:
    """Return the least and the greatest value of an output; equal if ``lower`` equals ``upper``.

    The mean (Takagi & Sugeno 1985) or the sum of the values of the functions, weighted by the
    firing strengths of their rules, which lie between two bounds in a type-2 system (Liang &
    Mendel 1999).

    Args:
        s: The functions.
        first: First function of the output.
        is_sum: Whether the output is the sum instead of the mean.
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`.
        x: The inputs.
        lower: Sum of the lower firing strengths of the rules of each function of the output.
        upper: Sum of the upper firing strengths; if all are zero, the result is nan.
    """
    if upper.sum() <= 0.0:
        return np.nan, np.nan
    count, width = len(lower), len(x) + 1
    values, low_weights, high_weights = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        row = (first + k) * width
        value = s.coefficients[row + width - 1]
        for i in range(len(x)):
            value += s.coefficients[row + i] * x[i]
        place = k  # the values of a mean are in ascending order
        while not is_sum and place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            low_weights[place] = low_weights[place - 1]
            high_weights[place] = high_weights[place - 1]
            place -= 1
        values[place], low_weights[place], high_weights[place] = value, lower[k], upper[k]
    if is_sum:
        low, high = 0.0, 0.0
        for k in range(count):
            a, b = lower[k] * values[k], upper[k] * values[k]
            low, high = low + min(a, b), high + max(a, b)
        return low, high
    return type_reduce(algorithm, values, low_weights, high_weights)
