"""Columns of numbers for the scripts of the report."""

from __future__ import annotations

import numpy as np
from jaxtyping import Num

from omnidrive.arrays import Array

_DECIMALS = 5  # 10 um, 10 us, 0.01 mm/s, 0.01 mrad/s; also gains


def column(values: Num[Array, " rows"], decimals: int = _DECIMALS) -> list[float | None]:
    """Return rounded values; those that are not finite become None."""
    rounded: list[float] = (np.round(values.astype(float), decimals) + 0.0).tolist()
    return [v if np.isfinite(v) else None for v in rounded]
