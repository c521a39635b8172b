"""What a robot can do, as rows of :class:`~omnidrive.control.nmpc.holonomic.problem.Limits`."""

from __future__ import annotations

from math import inf

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc.holonomic.problem import Limits
from omnidrive.errors import InvalidInput


def speed_limits(
    matrix: Float[Array, "rows 3"],
    bounds: Float[Array, " rows"] | float,
    dt: float,
    lag: tuple[float, float] = (0.0, 0.0),
) -> Limits:
    """``|matrix @ twist| <= bounds`` for what is asked of the actuators.

    With a lag, the twist follows what is asked, c, as ``b_k = b_{k-1} + (dt / lag)(c_k - b_k)``:
    backward Euler of ``lag db/dt = c - b``, which loses the same distance, ``lag`` times the change
    of speed. So ``c_k = (1 + lag/dt) b_k - (lag/dt) b_{k-1}``.

    Args:
        matrix: The wheel matrix, or the unit matrix to limit the body twist itself.
        bounds: Positive, one for each row or one for all.
        dt: Length of a stage, in s.
        lag: Time constants of translation and of rotation, in s.
    """
    for value in lag:
        if not 0.0 <= value < inf:
            raise InvalidInput(f"a lag must not be negative, got {value:g} s")
    part = np.array([lag[0], lag[0], lag[1]]) / dt
    return _limits(matrix, bounds, 1.0 + part, part)


def rate_limits(
    matrix: Float[Array, "rows 3"], bounds: Float[Array, " rows"] | float, dt: float
) -> Limits:
    """``|matrix @ (b_k - b_{k-1})| <= bounds dt``: acceleration of wheels, or of the body twist.

    Args:
        matrix: The wheel matrix, or the unit matrix.
        bounds: Positive, one for each row or one for all; the unit of the row per second.
        dt: Length of a stage, in s.
    """
    every = np.ones(3) / dt
    return _limits(matrix, bounds, every, every)


def joined(*parts: Limits) -> Limits:
    """All rows of several."""
    return Limits(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _limits(matrix: Array, bounds: Array | float, now: Array, before: Array) -> Limits:
    rows = np.ascontiguousarray(matrix, dtype=float)
    each = np.asarray(bounds, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != 3 or not np.isfinite(rows).all():
        raise InvalidInput(f"limits need a finite matrix of three columns, got {rows.shape}")
    if each.shape not in {(), (len(rows),)}:
        raise InvalidInput(f"{len(rows)} rows need one bound or {len(rows)}, got {each.shape}")
    if not (np.isfinite(each).all() and (each > 0.0).all()):
        raise InvalidInput(f"bounds must be positive and finite, got {np.min(each):g}")
    return Limits(rows * now, rows * before, each * np.ones(len(rows)))
