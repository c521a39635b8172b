"""Whole numbers of the processor, as kernels need them; their types are those of ``int``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.cpython.unsafe import numbers

int64: Any = np.int64
uint32: Any = np.uint32

trailing_zeros: Any = numbers.trailing_zeros
"""Number of the lowest bit that is 1."""
