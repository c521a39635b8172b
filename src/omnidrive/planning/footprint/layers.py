"""Free poses of a polygon on a grid, as one bitmap per heading."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, pi

import numpy as np
from jaxtyping import Bool, Complex, Float, Int, UInt64

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.footprint.raster import mark_hulls, runs_of
from omnidrive.planning.search.bit_ops import int64, uint64
from omnidrive.planning.search.bitgrid import MARGIN, BitGrid

HEADINGS = 72
"""Number of headings; heading k is k 5 degrees from the x axis of W."""
STEP = 2.0 * pi / HEADINGS
"""Angle between two headings, rad."""
_PARTS = 4  # of a turn by one step, each covered by hulls


@dataclass(frozen=True, eq=False)
class PoseLayers:
    """Bitmaps of the poses at which a polygon collides, with the origin of B at a cell centre.

    Attributes:
        grid: The map.
        polygon: The polygon, in m.
    """

    grid: OccupancyGrid
    polygon: Polygon

    @cached_property
    def frame(self) -> BitGrid:
        """Bitmap without free cells, whose indices and stride are those of every layer."""
        return BitGrid.full(*self.grid.occupied.shape)

    @cached_property
    def poses(self) -> UInt64[Array, "headings words"]:
        """Poses at which the polygon covers a part of an occupied square; exact.

        A move between adjacent cells along an axis is free over its whole course if both ends are:
        the polygon reaches into the rectangle that the square sweeps relative to it only if it
        reaches into one of its two halves. The same holds for a diagonal move whose four cells
        are free.
        """
        return self._layers(None)

    @cached_property
    def turns(self) -> UInt64[Array, "headings words"]:
        """Cells at which the turn from a heading to the next one collides anywhere on its course.

        The region that an edge sweeps is covered by the convex hulls of :func:`turn_hulls`. They
        exceed it by at most R d^2 / 8 with the farthest corner at R and d = 1.25 degrees: by 1e-3
        cells for a robot of R = 16 cells.
        """
        return self._layers(turn_hulls(self._complex(self.polygon.corners), self._angles))

    @property
    def _angles(self) -> Float[Array, " headings"]:
        """Headings relative to the grid, rad."""
        return STEP * np.arange(HEADINGS) - self.grid.yaw

    def _complex(self, points: Float[Array, "*n 2"]) -> Complex[Array, "*n"]:
        """Return points in B, in cells, as complex numbers."""
        scaled = points / self.grid.resolution
        complex_points: Complex[Array, "*n"] = scaled[..., 0] + 1j * scaled[..., 1]
        return complex_points

    def _layers(
        self, sweeps: Complex[Array, "headings hulls points"] | None
    ) -> UInt64[Array, "headings words"]:
        """Return the bitmaps of the polygon at each heading, and of the sweeps if given."""
        turned = self._complex(self.polygon.triangles) * np.exp(1j * self._angles)[:, None, None]
        sweeps = turned[:, :0] if sweeps is None else sweeps
        rows, cols = self.grid.occupied.shape
        reach = min(1.01 * self.polygon.radius / self.grid.resolution + 2.0, rows + cols + 0.0)
        pads = (min(ceil(reach), rows), min(ceil(reach), cols))
        source = _padded_bitmap(self.grid.occupied, self.grid.walled, pads)
        out = np.tile(self.frame.words, (HEADINGS, 1))
        _fill_layers(source, pads, (rows, cols), _reals(turned), _reals(sweeps), out)
        return out


def _reals(points: Complex[Array, "*n"]) -> Float[Array, "*n 2"]:
    """Return complex numbers as pairs (x, y)."""
    return np.ascontiguousarray(points)[..., None].view(float)


def turn_hulls(
    corners: Complex[Array, " corners"], angles: Float[Array, " headings"]
) -> Complex[Array, "headings hulls points"]:
    """Return points whose hulls cover the area that the edges sweep from each heading to the next.

    An edge is cut at the foot of the perpendicular from the centre of rotation. A point that turns
    by d stays in the triangle of its first and last position and of its middle position divided by
    cos(d / 2), in which the tangents meet. The hull of the triangles of both ends of a part of an
    edge contains those of all its points.

    Args:
        corners: Corners of the polygon relative to the centre of rotation.
        angles: First angle of each turn; it ends :data:`STEP` later.
    """
    ends = np.roll(corners, -1)
    along = ends - corners
    share = -(corners * along.conj()).real / np.abs(along) ** 2
    feet = corners + np.clip(share, 0.0, 1.0) * along
    parts = np.stack([np.concatenate([corners, feet]), np.concatenate([feet, ends])])
    parts = parts[:, np.abs(parts[0] - parts[1]) > 0.0]
    turn = STEP / _PARTS
    first = angles[:, None] + turn * np.arange(_PARTS)
    middle = np.exp(1j * (first + 0.5 * turn)) / np.cos(0.5 * turn)
    factors = np.stack([np.exp(1j * first), np.exp(1j * (first + turn)), middle], axis=-1)
    hulls = parts.T[None, None, :, :, None] * factors[:, :, None, None, :]
    points: Complex[Array, "headings hulls points"] = hulls.reshape(len(angles), -1, 6)
    return points


def _padded_bitmap(
    occupied: Bool[Array, "rows cols"], walled: bool, pads: tuple[int, int]
) -> UInt64[Array, "rows words"]:
    """Return the occupied cells as bits, lowest first, with padding on all sides.

    The padding is ``pads`` rows, and as many words as the columns of ``pads`` need and one more.
    """
    rows, cols = occupied.shape
    aside = 64 * (-(-pads[1] // 64) + 1)
    full = np.full((rows + 2 * pads[0], aside + 64 * -(-cols // 64) + aside), walled)
    full[pads[0] : pads[0] + rows, aside : aside + cols] = occupied
    return np.packbits(full, axis=1, bitorder="little").view(np.uint64)


@compiled
def _fill_layers(  # noqa: PLR0917
    source: UInt64[Array, "padded_rows padded_words"],
    pads: tuple[int, int],
    shape: tuple[int, int],
    triangles: Float[Array, "headings triangles 3 2"],
    sweeps: Float[Array, "headings hulls points 2"],
    out: UInt64[Array, "headings words"],
) -> None:
    """Write the layer of each heading into ``out``, whose bits are all 1."""
    wide, levels = 2 * pads[1] + 1, 1
    while 2 << (levels - 1) <= wide:
        levels += 1
    windows = _windows(source, levels)
    covered = np.empty((2 * pads[0] + 1, wide), np.bool_)
    for k in range(len(out)):
        covered[:] = False
        mark_hulls(triangles[k], covered)
        mark_hulls(sweeps[k], covered)
        _dilate(windows, pads, shape, runs_of(covered), out[k])


@compiled
def _windows(
    source: UInt64[Array, "rows words"], levels: int
) -> UInt64[Array, "levels rows words"]:
    """Return for each level i and cell whether any of the next 2^i cells of its row is occupied.

    Row ends are read as the last bit continued.
    """
    rows, count = source.shape
    windows = np.empty((levels, rows, count), np.uint64)
    windows[0] = source
    for level in range(1, levels):
        step = 1 << (level - 1)
        ahead, shift = step >> 6, uint64(step & 63)
        for row in range(rows):
            line = windows[level - 1, row]
            beyond = uint64(0) - (line[count - 1] >> uint64(63))
            for i in range(count):
                near = line[i + ahead] if i + ahead < count else beyond
                far = line[i + ahead + 1] if i + ahead + 1 < count else beyond
                moved = near >> shift | (far << uint64(1)) << (uint64(63) - shift)
                windows[level, row, i] = line[i] | moved
    return windows


@compiled
def _dilate(
    windows: UInt64[Array, "levels rows words"],
    pads: tuple[int, int],
    shape: tuple[int, int],
    runs: Int[Array, "runs 3"],
    out: UInt64[Array, " words"],
) -> None:
    """Clear the bits of ``out`` whose runs cover no occupied cell; the border keeps its bits.

    A run of n cells is the union of two windows of 2^i <= n cells.
    """
    rows, cols = shape
    count, aside = (cols + 63) // 64, (pads[1] + 63) // 64 + 1
    stride = count + MARGIN // 64
    border = uint64(0)
    if cols % 64:
        border = ~uint64(0) << uint64(cols % 64)
    for row in range(rows):
        at = (row + 1) * stride + 1
        line = out[at : at + count]
        line[:] = uint64(0)
        for k in range(len(runs)):
            first, last = runs[k, 1], runs[k, 2]
            level = 0
            while 2 << level <= last - first + 1:
                level += 1
            from_row = windows[level, row + pads[0] + runs[k, 0]]
            for begin in (first, last + 1 - (1 << level)):
                bit = 64 * aside + begin
                word, shift = bit >> 6, uint64(bit & 63)
                opposite = uint64(63) - shift
                near, far = from_row[word : word + count], from_row[word + 1 : word + 1 + count]
                for i in range(count):
                    line[i] |= near[i] >> shift | (far[i] << uint64(1)) << opposite
        line[count - 1] |= border


@compiled
def shared_moves(poses: UInt64[Array, "headings words"], stride: int) -> UInt64[Array, "4 words"]:
    """Return the moves that are free at one heading or more, as bits of the cell they start from.

    The moves are (0, 1), (1, 0), (1, 1) and (1, -1) in rows and columns; their reverses start from
    the cell at the other end. A diagonal move needs all four cells.
    """
    count, down = poses.shape[1], stride // 64
    moves = np.zeros((4, count), np.uint64)
    for k in range(len(poses)):
        layer = poses[k]
        for i in range(1, count - down - 1):
            here, below = ~layer[i], ~layer[i + down]
            right = here >> uint64(1) | (~layer[i + 1]) << uint64(63)
            left = here << uint64(1) | (~layer[i - 1]) >> uint64(63)
            below_right = below >> uint64(1) | (~layer[i + down + 1]) << uint64(63)
            below_left = below << uint64(1) | (~layer[i + down - 1]) >> uint64(63)
            moves[0, i] |= here & right
            moves[1, i] |= here & below
            moves[2, i] |= here & right & below & below_right
            moves[3, i] |= here & left & below & below_left
    return moves


@compiled
def is_set(words: UInt64[Array, " words"], index: int) -> bool:
    """Whether the bit of a cell is 1."""
    return bool(int64(words[index >> 6] >> uint64(index & 63)) & 1)
