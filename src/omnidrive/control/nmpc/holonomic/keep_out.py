"""A place to stay out of, as a user describes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc.holonomic.problem import KeepOuts
from omnidrive.errors import InvalidInput


@dataclass(frozen=True, eq=False, slots=True)
class KeepOut:
    """A convex polygon with rounded corners, or a disc, still or moving.

    Attributes:
        centres: Where it is, in m in W: one point, or one for each of the N + 1 states of a plan.
        radius: Distance to keep, in m: the robot's own radius, that of a disc, and a margin.
        corners: Counter-clockwise, in m from the centre; the default is one point, for a disc.
        weight: Cost of being too near, in 1/m^2. It is soft: the robot comes nearer than ``radius``
            by about the pull of its reference over twice this weight, in m.

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
            raise InvalidInput("the centres of a keep-out are finite points (x, y) in m")
        for name, value in (("radius", self.radius), ("weight", self.weight)):
            if not 0.0 < value < np.inf:
                raise InvalidInput(f"the {name} of a keep-out must be positive, got {value:g}")
        if self.corners is not None:
            _check_convex(np.asarray(self.corners))


def keep_outs(places: Sequence[KeepOut], points: int) -> KeepOuts:
    """Keep-outs for the kernels, of plans with so many ``points``: N + 1 for N stages.

    Raises:
        InvalidInput: One moves, but has another number of centres.
    """
    corners = [np.zeros((1, 2)) if p.corners is None else np.asarray(p.corners) for p in places]
    centres = np.empty((len(places), points, 2))
    for row, place in zip(centres, places, strict=True):
        if np.ndim(place.centres) == 2 and len(place.centres) != points:
            raise InvalidInput(
                f"a keep-out has {len(place.centres)} centres, but the plan {points} states"
            )
        row[:] = place.centres
    return KeepOuts(
        np.concatenate([np.empty((0, 2)), *corners]),
        np.cumsum([0, *map(len, corners)]),
        np.array([place.radius for place in places], dtype=float),
        np.array([place.weight for place in places], dtype=float),
        centres,
    )


def _check_convex(corners: Float[Array, "corners 2"]) -> None:
    if (
        corners.ndim != 2
        or corners.shape[1] != 2
        or not (len(corners) and np.isfinite(corners).all())
    ):
        raise InvalidInput("the corners of a keep-out are finite points (x, y) in m")
    edges = np.roll(corners, -1, axis=0) - corners
    after = np.roll(edges, -1, axis=0)
    turns = np.arctan2(
        edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0], (edges * after).sum(axis=1)
    )
    if len(corners) > 2 and ((turns < 0.0).any() or abs(turns.sum() - 2.0 * np.pi) > 1e-6):
        raise InvalidInput(
            "the corners of a keep-out must go round a convex polygon counter-clockwise; split one"
            " that is not convex, or reverse the order"
        )
