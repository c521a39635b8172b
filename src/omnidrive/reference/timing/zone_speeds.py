"""Speed limits that depend on the position."""

from __future__ import annotations

from collections.abc import Callable

from jaxtyping import Float

from omnidrive.arrays import Array

ZoneSpeeds = Callable[[Float[Array, "points 2"]], Float[Array, " points"]]
"""Largest speed, m/s, at points (x, y) in W, m."""
