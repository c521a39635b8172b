"""Limits of speeds and rates as rows of :class:`~omnidrive.control.nmpc.holonomic.Limits`."""

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
    """Return ``|matrix @ c_k| <= bounds`` for the commanded twists c_k.

    With a lag, the body twist b follows the commanded twist c as
    ``b_k = b_{k-1} + (dt / lag)(c_k - b_k)``: backward Euler of ``lag db/dt = c - b``, which loses
    the same distance as the exact solution, ``lag`` times the change of the twist. Hence
    ``c_k = (1 + lag/dt) b_k - (lag/dt) b_{k-1}``.

    Args:
        matrix: The wheel matrix, or the identity to limit the body twist itself.
        bounds: Positive, one for each row or one for all.
        dt: Length of a stage, in s.
        lag: Time constants of translation and of rotation, in s.

    Raises:
        InvalidInput: An argument is outside its domain.
    """
    for value in lag:
        if not 0.0 <= value < inf:
            raise InvalidInput(f"a lag must not be negative, got {value:g} s")
    ratio = np.array([lag[0], lag[0], lag[1]]) / dt
    return _limits(matrix, bounds, 1.0 + ratio, ratio)


def rate_limits(
    matrix: Float[Array, "rows 3"], bounds: Float[Array, " rows"] | float, dt: float
) -> Limits:
    """Return ``|matrix @ (b_k - b_{k-1})| <= bounds dt``: limits of accelerations.

    Args:
        matrix: The wheel matrix, or the identity to limit the body twist's acceleration.
        bounds: Positive, one for each row or one for all; the unit of the row per second.
        dt: Length of a stage, in s.

    Raises:
        InvalidInput: An argument is outside its domain.
    """
    scale = np.ones(3) / dt
    return _limits(matrix, bounds, scale, scale)


def stack_limits(*limits: Limits) -> Limits:
    """Return the rows of all arguments as one set of limits, inertial if the first one is."""
    return Limits(
        np.concatenate([each.now for each in limits]),
        np.concatenate([each.before for each in limits]),
        np.concatenate([each.bounds for each in limits]),
        limits[0].inertial,
    )


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
