"""A path with its headings as polynomial pieces: what a timing law runs along."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import wrap
from omnidrive.planning import SplinePath

FixedHeading = Literal["path", "tangent", "fixed"]
"""The path's own headings; the direction of travel; one heading throughout."""

_TURN = 0.25
"""Most that the heading turns on one piece, in rad."""

_MAX_TURN = 6.0
"""The same where pieces half as long would be too many, in rad: a corner of a way over cells that
turns back takes 4.7. Limits are kept as well, but the motion loses time: 23 % on a way of 200,000
cells with a right angle in every fourth, round which the robot turns within a cell."""

_MAX_PIECES = 250_000
"""A way of so many cells, 12 km of 0.05 m each; timing takes 1 GB."""


class Motion(NamedTuple):
    """Poses of B in W and their first two derivatives by the course's parameter s."""

    poses: Float[Array, "n 3"]
    slopes: Float[Array, "n 3"]
    bends: Float[Array, "n 3"]


@dataclass(frozen=True, eq=False, slots=True)
class Course:
    """Poses as a function of s, which grows by 1 on every piece.

    Attributes:
        pieces: Coefficients of 1, r, r^2 and r^3 on each piece, r = s - piece in [0, 1]; of x and
            y in m and yaw in rad. Poses and first derivatives are continuous.
        along: Whether the heading is the direction of travel instead; then the third column
            holds, in its first coefficient, the heading at each piece's start, unwrapped.
    """

    pieces: Float[Array, "pieces 4 3"]
    along: bool

    @classmethod
    def of(
        cls, path: SplinePath, heading: FixedHeading = "path", yaw: float | None = None
    ) -> Course:
        """Course along ``path`` with one of the three ways to head.

        Args:
            path: Where to go.
            heading: How to head.
            yaw: The heading of ``fixed``, in rad; by default the path's first.

        Raises:
            InvalidInput: ``yaw`` is not finite.
            InvalidReference: The path stands still, has more than 250,000 pieces, turns too
                often, or, with heading ``tangent``, has a point without a direction.
        """
        if yaw is not None and not np.isfinite(yaw):
            raise InvalidInput(f"the heading must be a finite angle in rad, got {yaw:g}")
        check_moves(path, 3 if heading == "path" else 2)
        count = len(path.control_points) - 3
        if count > _MAX_PIECES:
            raise InvalidReference(
                f"the path has {count:,} pieces, and at most {_MAX_PIECES:,} can be timed within "
                "limits; choose timing 'uniform', a coarser map, or a goal on the way"
            )
        while True:
            pieces = _cubics(path, count)
            if heading == "fixed":
                pieces[:, 1:, 2] = 0.0
                pieces[:, 0, 2] = path.poses(0.0)[2] if yaw is None else yaw
            course = cls(pieces, heading == "tangent")
            if course._settle_headings():
                return course
            if 2 * count > _MAX_PIECES:
                course._check_turns()
                return course
            count *= 2

    def at(self, piece: Int[Array, " n"], r: Float[Array, " n"]) -> Motion:
        """Poses, slopes and bends on pieces at r in [0, 1]; at piece ends, of that very piece."""
        c = self.pieces[piece]
        r = r[:, None]
        q = c[:, 0] + r * (c[:, 1] + r * (c[:, 2] + r * c[:, 3]))
        q1 = c[:, 1] + r * (2.0 * c[:, 2] + 3.0 * r * c[:, 3])
        q2 = 2.0 * c[:, 2] + 6.0 * r * c[:, 3]
        if self.along:
            (x0, y0), (x1, y1), (x2, y2), (x3, y3) = (
                part[:, :2].T for part in (c[:, 1], q1, q2, 6.0 * c[:, 3])
            )
            square, cross = x1 * x1 + y1 * y1, x1 * y2 - y1 * x2
            q[:, 2] = c[:, 0, 2] + np.arctan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)
            q1[:, 2] = cross / square
            q2[:, 2] = (x1 * y3 - y1 * x3 - 2.0 * (x1 * x2 + y1 * y2) * q1[:, 2]) / square
        return Motion(q, q1, q2)

    def body(
        self, motion: Motion
    ) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"], Float[Array, "n 3"]]:
        """Slopes in B, their derivative by s, and bends in B.

        With twist = slope ds/dt: d(R^T q')/ds = R^T q'' - yaw' z x R^T q', z up.
        """
        slopes, bends = (turned_into_body(part, motion.poses[:, 2]) for part in motion[1:])
        turn = slopes[:, 2]
        rates = bends.copy()
        rates[:, 0] += turn * slopes[:, 1]
        rates[:, 1] -= turn * slopes[:, 0]
        return slopes, rates, bends

    def _settle_headings(self) -> bool:
        """Fill in the headings of direction of travel; whether no piece turns too far."""
        if not self.along:
            return bool((self._most_turned() <= _TURN).all())
        turns, directions = self._tangents()
        if self._sharp(turns).any():
            return False
        self.pieces[:, 0, 2] = directions[0] + np.concatenate([[0.0], np.cumsum(turns)[:-1]])
        return True

    def _most_turned(self) -> Float[Array, " pieces"]:
        """Bound on how far the heading of each piece turns, in rad."""
        turned: Float[Array, " pieces"] = np.abs(self.pieces[:, 1:, 2]).sum(axis=1)
        return turned

    def _check_turns(self) -> None:
        """Refuse what turns too far on some piece, though there cannot be more of them."""
        if self.along:
            raise InvalidReference(self._without_direction())
        turned = self._most_turned()
        if turned.max() > _MAX_TURN:
            x, y, _ = self.pieces[np.argmax(turned), 0]
            raise InvalidReference(
                f"the heading turns too often to be timed within limits, most at ({x:.3f}, "
                f"{y:.3f}) m; choose heading 'fixed', or timing 'uniform'"
            )

    def _tangents(self) -> tuple[Float[Array, " pieces"], Float[Array, " pieces"]]:
        """By how much the direction of travel turns on each piece, and where it starts; rad."""
        starts = self.pieces[:, 1, :2]
        ends = self.pieces[:, 1, :2] + 2.0 * self.pieces[:, 2, :2] + 3.0 * self.pieces[:, 3, :2]
        directions = np.arctan2(*starts.T[::-1])
        return wrap(np.arctan2(*ends.T[::-1]) - directions), directions

    def _sharp(self, turns: Float[Array, " pieces"]) -> Bool[Array, " pieces"]:
        """Pieces that turn too far, or whose hodograph's hull is near the origin.

        The hodograph of a cubic is a parabola within the triangle of its control points d0, d1, d2;
        all of them far along d0 + d2 keep the speed off zero and the turn below pi.
        """
        c1, c2, c3 = (self.pieces[:, k, :2] for k in (1, 2, 3))
        d = np.stack([c1, c1 + c2, c1 + 2.0 * c2 + 3.0 * c3])
        axis = d[0] + d[2]
        along = (d * axis).sum(axis=2)
        least = 1e-3 * np.linalg.norm(axis, axis=1) * np.linalg.norm(d, axis=2).max(axis=0)
        still: Bool[Array, " pieces"] = ~((along > least).all(axis=0)) | (np.abs(turns) > _TURN)
        return still

    def _without_direction(self) -> str:
        turns, _ = self._tangents()
        x, y, _ = self.pieces[np.argmax(self._sharp(turns)), 0]
        return (
            f"the path has no direction, or turns on the spot, at ({x:.3f}, {y:.3f}) m, so that "
            "the heading cannot be tangent to it; choose heading 'path', 'fixed' or 'free'"
        )


def turned_into_body(
    vectors: Float[Array, "n 3"], yaw: float | Float[Array, " n"]
) -> Float[Array, "n 3"]:
    """Planar vectors (x, y, yaw) of W written in a frame of heading ``yaw``; yaw parts as is."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, turn = vectors.T
    return np.stack([c * x + s * y, c * y - s * x, turn], axis=1)


def check_moves(path: SplinePath, columns: int) -> None:
    """Refuse a path that does not move in its first two columns, or in any of all three.

    Raises:
        InvalidReference: It only turns, or it stands still.
    """
    moves = np.ptp(path.control_points, axis=0) > 0.0
    if moves[:columns].any():
        return
    x, y, _ = path.control_points[0]
    raise InvalidReference(
        f"the path only turns at ({x:g}, {y:g}) m: choose heading 'path', which can"
        if moves[2]
        else f"the path stands still at ({x:g}, {y:g}) m: there is nothing to time"
    )


def _cubics(path: SplinePath, count: int) -> Float[Array, "pieces 4 3"]:
    """The path on ``count`` equal pieces: a cubic is given by its ends (Hermite)."""
    u = np.arange(count + 1) / count
    q, slopes = path.poses(u), path.first_derivatives(u) / count
    step, first, last = np.diff(q, axis=0), slopes[:-1], slopes[1:]
    return np.stack(
        [q[:-1], first, 3.0 * step - 2.0 * first - last, first + last - 2.0 * step], axis=1
    )
