"""Integer types and bit operations for kernels, typed as ``Any`` so that they mix with ``int``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.cpython.unsafe import numbers

int64: Any = np.int64
uint32: Any = np.uint32
uint64: Any = np.uint64

trailing_zeros: Any = numbers.trailing_zeros
"""Index of the lowest bit that is 1."""

leading_zeros: Any = numbers.leading_zeros
"""Number of 0 bits above the highest bit that is 1."""
