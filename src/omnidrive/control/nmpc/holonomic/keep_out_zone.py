"""Keep-out zones as a user describes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc.holonomic.problem import KeepOutArrays
from omnidrive.errors import InvalidInput


@dataclass(frozen=True, eq=False, slots=True)
class KeepOutZone:
    """A convex polygon with rounded corners, or a disc, fixed or moving.

    Attributes:
        centres: Centre in m in W: one point, or one for each of the N + 1 states of a plan.
        radius: Distance to keep, in m: the sum of the robot's radius, a disc's own radius, and a
            margin.
        corners: Counter-clockwise, in m relative to the centre; the default is one point: a disc.
        weight: Penalty in 1/m^2. The constraint is soft: the robot violates ``radius`` by about
            the gradient of the remaining cost over twice this weight, in m.

    Raises:
        InvalidInput: A shape or value is outside its domain, or the polygon is not convex.
    """

    centres: Float[Array, "*points 2"]
    radius: float
    corners: Float[Array, "corners 2"] | None = None
    weight: float = 1e4

    def __post_init__(self) -> None:
        centres = np.asarray(self.centres)
        if centres.shape[-1:] != (2,) or centres.ndim > 2 or not np.isfinite(centres).all():
            raise InvalidInput("the centres of a keep-out zone must be finite points (x, y) in m")
        for name, value in (("radius", self.radius), ("weight", self.weight)):
            if not 0.0 < value < np.inf:
                raise InvalidInput(f"the {name} of a keep-out zone must be positive, got {value:g}")
        if self.corners is not None:
            _check_convex(np.asarray(self.corners))


KeepOutForecast = Callable[[float, int, float], Sequence[KeepOutZone]]
"""``keep_outs(t, points, dt)``: keep-out zones over a horizon that starts at ``t`` (s).

A moving zone has one centre for each of the ``points`` times t, t + dt, ...; see
:class:`KeepOutZone`."""


@dataclass(frozen=True, eq=False, slots=True)
class FixedKeepOuts:
    """A :data:`KeepOutForecast` with the same zones at all times."""

    zones: tuple[KeepOutZone, ...]

    def __call__(self, t: float, points: int, dt: float) -> Sequence[KeepOutZone]:
        """Return the zones."""
        return self.zones


def forecast_keep_outs(zones: KeepOutForecast | Sequence[KeepOutZone]) -> KeepOutForecast:
    """Return the zones as a function of time; a sequence is the same at all times."""
    if callable(zones):
        return zones
    return FixedKeepOuts(tuple(zones))


def stack_keep_outs(zones: Sequence[KeepOutZone], points: int) -> KeepOutArrays:
    """Return the zones as arrays for a plan with ``points`` states: N + 1 for N stages.

    Raises:
        InvalidInput: A moving zone has another number of centres.
    """
    corners = [np.zeros((1, 2)) if z.corners is None else np.asarray(z.corners) for z in zones]
    centres = np.empty((len(zones), points, 2))
    for row, zone in zip(centres, zones, strict=True):
        if np.ndim(zone.centres) == 2 and len(zone.centres) != points:
            raise InvalidInput(
                f"a keep-out zone has {len(zone.centres)} centres, but the plan has {points} states"
            )
        row[:] = zone.centres
    return KeepOutArrays(
        np.concatenate([np.empty((0, 2)), *corners]),
        np.cumsum([0, *map(len, corners)]),
        np.array([zone.radius for zone in zones], dtype=float),
        np.array([zone.weight for zone in zones], dtype=float),
        centres,
    )


def _check_convex(corners: Float[Array, "corners 2"]) -> None:
    if (
        corners.ndim != 2
        or corners.shape[1] != 2
        or not (len(corners) and np.isfinite(corners).all())
    ):
        raise InvalidInput("the corners of a keep-out zone must be finite points (x, y) in m")
    edges = np.roll(corners, -1, axis=0) - corners
    after = np.roll(edges, -1, axis=0)
    turns = np.arctan2(
        edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0], (edges * after).sum(axis=1)
    )
    if len(corners) > 2 and ((turns < 0.0).any() or abs(turns.sum() - 2.0 * np.pi) > 1e-6):
        raise InvalidInput(
            "the corners of a keep-out zone must form a convex polygon in counter-clockwise order;"
            " split a polygon that is not convex, or reverse the order"
        )
