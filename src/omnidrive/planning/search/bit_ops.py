"""Integer types and bit operations for compiled kernels.

They are annotated as ``Any``, because kernels mix them with ``int``, which a static type check of
NumPy integers would reject.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba.extending import intrinsic

int64: Any = np.int64
uint32: Any = np.uint32
uint64: Any = np.uint64

_integer: Any = ir.IntType  # llvmlite has no types


def _trailing_zeros(_: Any, value: Any) -> Any:
    """Index of the lowest bit that is 1; for 0 the width of the type in bits."""

    def build(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        """Emit LLVM's instruction, whose flag leaves the result for 0 defined."""
        return builder.cttz(arguments[0], _integer(1)(0))

    return value(value), build


def _leading_zeros(_: Any, value: Any) -> Any:
    """Number of 0 bits above the highest bit that is 1; for 0 the width of the type in bits."""

    def build(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        """Emit LLVM's instruction, whose flag leaves the result for 0 defined."""
        return builder.ctlz(arguments[0], _integer(1)(0))

    return value(value), build


trailing_zeros: Any = intrinsic(_trailing_zeros)
"""Return the index of the lowest bit that is 1; for 0 the width of the type in bits."""

leading_zeros: Any = intrinsic(_leading_zeros)
"""Return the number of 0 bits above the highest bit that is 1; for 0 the width of the type."""
