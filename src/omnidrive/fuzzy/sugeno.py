"""Sugeno conclusions: weighted means and sums of linear functions of the inputs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.consequents import Shape
from omnidrive.fuzzy.reduction import reduced
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import LinearFunction


class Functions(NamedTuple):
    """The linear functions that rules conclude, flat."""

    coefficients: Float[Array, " coefficients"]
    """Of each: one per input, then the constant."""


def functions_of(system: FuzzySystem, shapes: tuple[tuple[Shape, ...], ...]) -> Functions:
    """Linear functions of all outputs."""
    rows: list[float] = []
    for own in shapes:
        for shape in own:
            assert isinstance(shape.of, LinearFunction)
            rows += shape.of.coefficients or (0.0,) * len(system.inputs)
            rows.append(shape.of.constant)
    return Functions(np.array(rows))


@compiled
def sugeno_interval(  # noqa: PLR0917
    s: Functions,
    first: int,
    summed: bool,
    algorithm: int,
    x: Float[Array, " inputs"],
    lower: Float[Array, " functions"],
    upper: Float[Array, " functions"],
) -> tuple[float, float]:
    """Least and greatest output; equal where ``lower`` and ``upper`` are.

    The mean (Takagi & Sugeno 1985) or the sum of the functions' values, weighted by the strengths
    of their rules, which lie between two bounds in a system of type 2 (Liang & Mendel 1999).

    Args:
        s: The functions.
        first: First function of the output.
        summed: Whether the output is a sum, not a mean.
        algorithm: Index in :data:`~omnidrive.fuzzy.system.ALGORITHMS`.
        x: The inputs.
        lower: Sum of the least strengths of the rules that conclude each function of the output.
        upper: Sum of their greatest strengths; where all are zero, the output is nan.
    """
    if upper.sum() <= 0.0:
        return np.nan, np.nan
    count, width = len(lower), len(x) + 1
    values = np.empty(count)
    for k in range(count):
        row = (first + k) * width
        value = s.coefficients[row + width - 1]
        for i in range(len(x)):
            value += s.coefficients[row + i] * x[i]
        values[k] = value
    if summed:
        low, high = 0.0, 0.0
        for k in range(count):
            a, b = lower[k] * values[k], upper[k] * values[k]
            low, high = low + min(a, b), high + max(a, b)
        return low, high
    order = np.argsort(values)
    at, low_weights, high_weights = values[order], lower[order], upper[order]
    return reduced(algorithm, at, low_weights, high_weights)
