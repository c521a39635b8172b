"""Paths with headings as piecewise polynomials, the input of time parameterization."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import wrap
from omnidrive.parameter import check_choice
from omnidrive.planning import SplinePath

FixedHeading = Literal["path", "tangent", "fixed"]
"""Headings of the path; direction of travel; one constant heading."""

_TURN = 0.25
"""Largest change of heading on one piece, in rad."""

_MAX_TURN = 6.0
"""Largest change of heading on one piece if halving the pieces would make too many, in rad. The
corner of a grid path that turns back takes 4.7 rad. Limits are still met, but the motion takes
longer: by 23 % on a grid path of 200,000 cells with a right angle in every fourth cell, at each of
which the robot turns within one cell."""

_MAX_PIECES = 250_000
"""Cells of a grid path of 12 km at 0.05 m per cell; time parameterization takes 1 GB."""


class PathDerivatives(NamedTuple):
    """Poses of B in W and their first and second derivatives with respect to s."""

    poses: Float[Array, "n 3"]
    first_derivatives: Float[Array, "n 3"]
    second_derivatives: Float[Array, "n 3"]


@dataclass(frozen=True, eq=False, slots=True)
class PiecewisePath:
    """Poses as piecewise cubic functions of s, which increases by 1 on each piece.

    Attributes:
        pieces: Coefficients of 1, r, r^2 and r^3 on each piece, with r = s - piece in [0, 1]; x and
            y in m, yaw in rad. Poses and first derivatives are continuous.
        tangent: Whether the heading is the direction of travel. If so, the first yaw coefficient of
            each piece is the heading at its start, unwrapped, and the others are not used.
    """

    pieces: Float[Array, "pieces 4 3"]
    tangent: bool

    @classmethod
    def of(
        cls, path: SplinePath, heading: FixedHeading = "path", yaw: float | None = None
    ) -> PiecewisePath:
        """Convert a spline path, with one of three kinds of heading.

        Args:
            path: Path to follow.
            heading: Kind of heading.
            yaw: Heading for ``fixed``, in rad; None: the first heading of the path.

        Raises:
            InvalidInput: ``heading`` is unknown, or ``yaw`` is not finite.
            InvalidReference: The path does not move, has more than 250,000 pieces, turns too
                often, or, with heading ``tangent``, has a point without a direction of travel.
        """
        check_choice("heading", heading, get_args(FixedHeading))
        if yaw is not None and not np.isfinite(yaw):
            raise InvalidInput(f"the heading must be a finite angle in rad, got {yaw:g}")
        check_path_moves(path, 3 if heading == "path" else 2)
        count = len(path.control_points) - 3
        if count > _MAX_PIECES:
            raise InvalidReference(
                f"the path has {count:,} pieces, and at most {_MAX_PIECES:,} can be timed within "
                "limits; choose timing 'uniform', a coarser map, or a nearer goal"
            )
        while True:
            pieces = _hermite_pieces(path, count)
            if heading == "fixed":
                pieces[:, 1:, 2] = 0.0
                pieces[:, 0, 2] = path.poses(0.0)[2] if yaw is None else yaw
            converted = cls(pieces, heading == "tangent")
            if converted._set_headings():
                return converted
            if 2 * count > _MAX_PIECES:
                converted._check_turns()
                return converted
            count *= 2

    @classmethod
    def concatenated(cls, paths: Sequence[SplinePath]) -> PiecewisePath:
        """Convert spline paths, each of which starts at the end of the one before.

        Their headings are kept. Each piece is divided into the same number of pieces. First
        derivatives may jump where two paths meet: there the robot has to rest.

        Raises:
            InvalidReference: There are too many pieces, or the heading turns too often.
        """
        counts = [len(path.control_points) - 3 for path in paths]
        parts = 1
        while True:
            pieces = [_hermite_pieces(p, parts * n) for p, n in zip(paths, counts, strict=True)]
            converted = cls(np.concatenate(pieces), tangent=False)
            if converted._set_headings():
                return converted
            if 2 * parts * sum(counts) > _MAX_PIECES:
                converted._check_turns()
                return converted
            parts *= 2

    def at(self, piece: Int[Array, " n"], r: Float[Array, " n"]) -> PathDerivatives:
        """Evaluate the given pieces at r in [0, 1]; at its ends, a piece is evaluated one-sided."""
        c = self.pieces[piece]
        r = r[:, None]
        q = c[:, 0] + r * (c[:, 1] + r * (c[:, 2] + r * c[:, 3]))
        q1 = c[:, 1] + r * (2.0 * c[:, 2] + 3.0 * r * c[:, 3])
        q2 = 2.0 * c[:, 2] + 6.0 * r * c[:, 3]
        if self.tangent:
            (x0, y0), (x1, y1), (x2, y2), (x3, y3) = (
                part[:, :2].T for part in (c[:, 1], q1, q2, 6.0 * c[:, 3])
            )
            square, cross = x1 * x1 + y1 * y1, x1 * y2 - y1 * x2
            q[:, 2] = c[:, 0, 2] + np.arctan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)
            q1[:, 2] = cross / square
            q2[:, 2] = (x1 * y3 - y1 * x3 - 2.0 * (x1 * x2 + y1 * y2) * q1[:, 2]) / square
        return PathDerivatives(q, q1, q2)

    def third_derivatives(self, piece: Int[Array, " n"]) -> Float[Array, "n 3"]:
        """Return the third derivatives on the given pieces; those of a tangent heading as 0."""
        third: Float[Array, "n 3"] = 6.0 * self.pieces[piece, 3]
        if self.tangent:
            third[:, 2] = 0.0
        return third

    def _set_headings(self) -> bool:
        """Set the headings of a tangent path; return whether no piece turns too far."""
        if not self.tangent:
            return bool((self._turn_bounds() <= _TURN).all())
        turns, directions = self._tangents()
        if self._sharp(turns).any():
            return False
        self.pieces[:, 0, 2] = directions[0] + np.concatenate([[0.0], np.cumsum(turns)[:-1]])
        return True

    def _turn_bounds(self) -> Float[Array, " pieces"]:
        """Upper bound of the change of heading on each piece, in rad."""
        bounds: Float[Array, " pieces"] = np.abs(self.pieces[:, 1:, 2]).sum(axis=1)
        return bounds

    def _check_turns(self) -> None:
        """Raise an error if a piece turns too far although the pieces cannot be halved again."""
        if self.tangent:
            raise InvalidReference(self._no_direction_message())
        bounds = self._turn_bounds()
        if bounds.max() > _MAX_TURN:
            x, y, _ = self.pieces[np.argmax(bounds), 0]
            raise InvalidReference(
                f"the heading turns too often to be timed within limits, most at ({x:.3f}, "
                f"{y:.3f}) m; choose heading 'fixed', or timing 'uniform'"
            )

    def _tangents(self) -> tuple[Float[Array, " pieces"], Float[Array, " pieces"]]:
        """Return the change of the direction of travel on each piece, and its start, in rad."""
        starts = self.pieces[:, 1, :2]
        ends = self.pieces[:, 1, :2] + 2.0 * self.pieces[:, 2, :2] + 3.0 * self.pieces[:, 3, :2]
        directions = np.arctan2(*starts.T[::-1])
        return wrap(np.arctan2(*ends.T[::-1]) - directions), directions

    def _sharp(self, turns: Float[Array, " pieces"]) -> Bool[Array, " pieces"]:
        """Return which pieces turn too far, or have a hodograph whose hull is near the origin.

        The hodograph of a cubic is a parabola within the triangle of its control points d0, d1, d2.
        If all of them are far along d0 + d2, the speed is not zero and the turn is below pi.
        """
        c1, c2, c3 = (self.pieces[:, k, :2] for k in (1, 2, 3))
        d = np.stack([c1, c1 + c2, c1 + 2.0 * c2 + 3.0 * c3])
        axis = d[0] + d[2]
        along = (d * axis).sum(axis=2)
        minimum = 1e-3 * np.linalg.norm(axis, axis=1) * np.linalg.norm(d, axis=2).max(axis=0)
        sharp: Bool[Array, " pieces"] = ~((along > minimum).all(axis=0)) | (np.abs(turns) > _TURN)
        return sharp

    def _no_direction_message(self) -> str:
        turns, _ = self._tangents()
        x, y, _ = self.pieces[np.argmax(self._sharp(turns)), 0]
        return (
            f"the path has no direction of travel, or turns on the spot, at ({x:.3f}, {y:.3f}) m, "
            "so that the heading cannot be tangent to it; choose heading 'path', 'fixed' or 'free'"
        )


def body_derivatives(
    motion: PathDerivatives,
) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Return q' in B, the derivative of that with respect to s, and q'' in B.

    The body twist is R^T q' ds/dt, and d(R^T q')/ds = R^T q'' - yaw' z x R^T q' with z up.
    """
    first, second = (rotate_into_body(part, motion.poses[:, 2]) for part in motion[1:])
    change = second.copy()
    change[:, 0] += first[:, 2] * first[:, 1]
    change[:, 1] -= first[:, 2] * first[:, 0]
    return first, change, second


def rotate_into_body(
    vectors: Float[Array, "n 3"], yaw: float | Float[Array, " n"]
) -> Float[Array, "n 3"]:
    """Return planar vectors (x, y, yaw) of W in a frame of heading ``yaw``; yaw is unchanged."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, turn = vectors.T
    return np.stack([c * x + s * y, c * y - s * x, turn], axis=1)


def check_path_moves(path: SplinePath, columns: int) -> None:
    """Check that a path moves in its first two columns (x, y), or in any of all three.

    Raises:
        InvalidReference: It only turns, or does not move.
    """
    moves = np.ptp(path.control_points, axis=0) > 0.0
    if moves[:columns].any():
        return
    x, y, _ = path.control_points[0]
    raise InvalidReference(
        f"the path only turns on the spot at ({x:g}, {y:g}) m: choose heading 'path'"
        if moves[2]
        else f"the path stands still at ({x:g}, {y:g}) m: there is no motion to time"
    )


def _hermite_pieces(path: SplinePath, count: int) -> Float[Array, "pieces 4 3"]:
    """Return the path as ``count`` cubics (Hermite interpolation of equal pieces)."""
    u = np.arange(count + 1) / count
    q, q1 = path.poses(u), path.first_derivatives(u) / count
    step, first, last = np.diff(q, axis=0), q1[:-1], q1[1:]
    return np.stack(
        [q[:-1], first, 3.0 * step - 2.0 * first - last, first + last - 2.0 * step], axis=1
    )
