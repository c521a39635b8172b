"""Whole numbers of the processor, as kernels need them; their types are those of ``int``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.cpython.unsafe import numbers

int64: Any = np.int64
uint32: Any = np.uint32
uint64: Any = np.uint64

trailing_zeros: Any = numbers.trailing_zeros
"""Number of the lowest bit that is 1."""

leading_zeros: Any = numbers.leading_zeros
"""Number of bits of 0 before the highest bit that is 1."""
