"""Integer types and bit operations for compiled kernels.

They are annotated as ``Any``, because kernels mix them with ``int``, which a static type check of
NumPy integers would reject.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.cpython.unsafe import numbers

int64: Any = np.int64
uint32: Any = np.uint32
uint64: Any = np.uint64

trailing_zeros: Any = numbers.trailing_zeros
"""Index of the lowest bit that is 1; for 0 the width of the type in bits."""

leading_zeros: Any = numbers.leading_zeros
"""Number of 0 bits above the highest bit that is 1; for 0 the width of the type in bits."""
