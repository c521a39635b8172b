"""Many arrays packed into two: every argument of a compiled function costs time at each call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.views import unsafe_slice


class PackedArrays(NamedTuple):
    """Arrays of floats and arrays of integers, each kind concatenated."""

    floats: Float[Array, " floats"]
    integers: Int[Array, " integers"]
    """Starts with the begin and end of every array, in the order of packing."""


def pack(arrays: Sequence[Array]) -> PackedArrays:
    """Pack one-dimensional arrays of integers and of floats."""
    header: list[int] = []
    floats: list[Array] = []
    integers: list[Array] = []
    ends = {True: 2 * len(arrays), False: 0}  # key: whether the array holds integers
    for array in arrays:
        whole = bool(np.issubdtype(array.dtype, np.integer))
        (integers if whole else floats).append(array)
        header += [ends[whole], ends[whole] + len(array)]
        ends[whole] += len(array)
    return PackedArrays(
        np.concatenate([*floats, np.empty(0)]),
        np.concatenate([np.array(header, dtype=np.int64), *integers]).astype(np.int64),
    )


@compiled
def floats_of(packed: PackedArrays, k: int) -> Float[Array, " floats"]:
    """Return array ``k``, which holds floats."""
    return unsafe_slice(packed.floats, packed.integers[2 * k], packed.integers[2 * k + 1])


@compiled
def integers_of(packed: PackedArrays, k: int) -> Int[Array, " integers"]:
    """Return array ``k``, which holds integers."""
    return unsafe_slice(packed.integers, packed.integers[2 * k], packed.integers[2 * k + 1])
