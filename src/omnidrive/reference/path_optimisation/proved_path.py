"""Paths optimised for time along which a polygon is proved to be free."""

from __future__ import annotations

from contextlib import suppress
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.planning.deadline import Deadline
from omnidrive.planning.footprint import unproved_pieces
from omnidrive.reference.path_optimisation.transcription import InitialGuess, Transcription
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.piecewise_path import PiecewisePath
from omnidrive.reference.timing.time_parameterization import time_optimal_reference

_ROUNDS = 5
"""Largest number of optimisations, in ever narrower bounds."""
_NARROWER = 0.3
"""Factor of the bounds about pieces that are not proved."""
_SHARES = (0.7, 0.4, 0.2, 0.1, 0.03, 0.0)
"""Shares of the way from the start path to the optimum that are tried about such pieces."""
_TAPER = 0.08
"""Largest difference of the shares of neighbouring control points."""
_MOST = 3.0
"""Largest bound of the position, in m, and of the yaw, in rad."""


class ProvedPath(NamedTuple):
    """Path on which the polygon is free as on the start path, or proved to be free.

    Attributes:
        path: The path, with as many control points as the start path.
        source: ``converged`` or ``capped``: how the optimisation that gave it ended.
        share: Mean share of the way from the start path to the optimum, over the control points.
        rounds: Number of optimisations up to this optimum, each but the first in narrower bounds.
    """

    path: SplinePath
    source: Literal["converged", "capped"]
    share: float
    rounds: int


class ProofMap(NamedTuple):
    """Start path and map, on which paths near it are proved.

    Attributes:
        start: Path on which the polygon is free.
        polygon: The polygon.
        grid: The map.
    """

    start: SplinePath
    polygon: Polygon
    grid: OccupancyGrid

    def unproved(self, path: SplinePath) -> list[int]:
        """Return the pieces that are neither proved nor those of the start path."""
        same = (path.control_points == self.start.control_points).all(axis=1)
        return [
            piece
            for piece in unproved_pieces(self.grid, self.polygon.corners, path)
            if not same[piece : piece + 4].all()
        ]

    def blended(self, optimum: SplinePath, failing: list[int]) -> tuple[SplinePath, float]:
        """Return a proved path between the start path and an optimum, and its mean share."""
        start = self.start.control_points
        levels = np.full(len(start), -1)
        path, shares = optimum, np.ones(len(start))
        while failing:
            near = np.unique(np.add.outer(failing, np.arange(4)))
            levels[near] = np.minimum(levels[near] + 1, len(_SHARES) - 1)
            least = np.where(levels < 0, 1.0, np.take(_SHARES, levels))
            shares = _tapered(least)
            moved = start + shares[:, None] * (optimum.control_points - start)
            path = SplinePath(np.where(shares[:, None] == 0.0, start, moved))
            failing = self.unproved(path)
        return path, float(shares.mean())


def fastest_proved(
    proof: ProofMap,
    limits: tuple[LimitRows, ...],
    yaws_fixed: tuple[bool, bool],
    deadline: Deadline | None = None,
) -> ProvedPath | None:
    """Return the fastest path found near a start path; None if none is faster.

    The control points are optimised within bounds about those of the start path, as wide as the
    room about it. Where a piece of the optimum is not proved, its control points are moved back
    towards the start path, whose pieces are free, until all are proved; and the bounds are narrowed
    for the next optimisation.

    Args:
        proof: Start path, polygon and map.
        limits: Limits of speeds and accelerations.
        yaws_fixed: Whether the headings at start and goal stay.
        deadline: Time limit; None: none.
    """
    start = proof.start
    bounds = _room(*proof)
    bounds[[0, -1], :2] = 0.0
    for end, is_fixed in zip((0, -1), yaws_fixed, strict=True):
        bounds[end, 2] *= not is_fixed
    timed = time_optimal_reference(PiecewisePath.of(start), limits)
    fastest, best = timed.duration, None
    points, guess = start.control_points, start
    transcription = Transcription(
        len(points), start.length, limits, time_limit=None if deadline is None else deadline.left
    )
    for rounds in range(1, _ROUNDS + 1):
        if deadline is not None and deadline.remaining <= 0.0:
            break
        low, high = points - bounds, points + bounds
        guess = SplinePath(np.clip(guess.control_points, low, high))
        with suppress(InvalidReference):
            timed = time_optimal_reference(PiecewisePath.of(guess), limits)
        optimum, converged = transcription.solve(InitialGuess(guess, low, high), timed)
        failing = proof.unproved(optimum)
        path, share = proof.blended(optimum, failing)
        with suppress(InvalidReference):  # the solver may return a path that does not move
            duration = time_optimal_reference(PiecewisePath.of(path), limits).duration
            if duration < fastest:
                fastest = duration
                source: Literal["converged", "capped"] = "converged" if converged else "capped"
                best = ProvedPath(path, source, share, rounds)
        if not failing:
            break
        near = np.ones(len(points))
        near[np.unique(np.add.outer(failing, np.arange(4)))] = _NARROWER
        bounds *= _tapered(near)[:, None]
        guess = path
    return best


def _room(start: SplinePath, polygon: Polygon, grid: OccupancyGrid) -> Float[Array, "points 3"]:
    """Return bounds, in m and rad, of the control points about those of a start path.

    The position may move as far as a disc with the least distance of an edge from the origin of B
    has room, or a cell; the yaw as far as the farthest corner then moves, or without bounds where
    the disc through that corner has room.
    """
    room = grid.clearance(start.control_points[:, :2])
    inner = _inner_radius(polygon)
    move = np.clip(room - inner, grid.resolution, _MOST)
    turn = np.where(room > polygon.radius, _MOST, np.minimum(move / polygon.radius, _MOST))
    return np.column_stack([move, move, turn])


def _inner_radius(polygon: Polygon) -> float:
    """Return the least distance of the outline from the origin of B, in m; 0 if it is outside."""
    if not polygon.contains(np.zeros(2)):
        return 0.0
    along = np.roll(polygon.corners, -1, axis=0) - polygon.corners
    share = -(polygon.corners * along).sum(axis=1) / (along**2).sum(axis=1)
    feet = polygon.corners + np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.hypot(*feet.T).min())


def _tapered(shares: Float[Array, " points"]) -> Float[Array, " points"]:
    """Return the largest shares, none larger than given, whose neighbours differ by a slope."""
    index = np.arange(len(shares))
    rising = shares[None, :] + _TAPER * np.abs(index[:, None] - index[None, :])
    tapered: Float[Array, " points"] = np.minimum(shares, rising.min(axis=1))
    return tapered
