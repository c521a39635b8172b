"""Array type of shape annotations such as ``Float[Array, "rows 3"]``."""

from __future__ import annotations

import numpy as np

Array = np.ndarray
