"""Many arrays in two, because each argument of a compiled function costs time at every call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.unsafe_views import part


class Packed(NamedTuple):
    """Arrays of numbers and of integers, one after the other."""

    numbers: Float[Array, " numbers"]
    integers: Int[Array, " integers"]
    """Begins with where each array begins and ends, in the order in which they were packed."""


def pack(arrays: Sequence[Array]) -> Packed:
    """One-dimensional arrays, each of integers or of numbers, as one value."""
    header: list[int] = []
    numbers: list[Array] = []
    integers: list[Array] = []
    ends = {True: 2 * len(arrays), False: 0}  # by whether an array is of integers
    for array in arrays:
        whole = bool(np.issubdtype(array.dtype, np.integer))
        (integers if whole else numbers).append(array)
        header += [ends[whole], ends[whole] + len(array)]
        ends[whole] += len(array)
    return Packed(
        np.concatenate([*numbers, np.empty(0)]),
        np.concatenate([np.array(header, dtype=np.int64), *integers]).astype(np.int64),
    )


@compiled
def numbers_of(packed: Packed, k: int) -> Float[Array, " numbers"]:
    """Array ``k``, which holds numbers."""
    return part(packed.numbers, packed.integers[2 * k], packed.integers[2 * k + 1])


@compiled
def integers_of(packed: Packed, k: int) -> Int[Array, " integers"]:
    """Array ``k``, which holds integers."""
    return part(packed.integers, packed.integers[2 * k], packed.integers[2 * k + 1])
