"""Length of a spline between bounds."""

from __future__ import annotations

import numpy as np

from omnidrive.planning.parts import Parts
from omnidrive.planning.pieces import Pieces

_MOST_PARTS = 1_000_000
_ROUNDING = 1e-12  # relative


def length_bounds(pieces: Pieces, tolerance: float) -> tuple[float, float]:
    """Bounds on the length, in the points' unit, no further apart than ``tolerance`` times it.

    A part of a cubic is no shorter than its chord and no longer than the polygon of its Bezier
    control points (Gravesen 1997, "Adaptive subdivision and the length and energy of Bezier
    curves"). Parts on which these differ too much are halved.
    """
    parts, lower, upper = Parts.of(pieces), 0.0, 0.0
    share = tolerance / len(parts.slopes)
    while True:
        # a third of the width times these are the sides of the polygon
        hodograph = parts.hodograph()
        chords = np.linalg.norm(hodograph.sum(axis=0), axis=-1) * parts.width / 3.0
        polygons = np.linalg.norm(hodograph, axis=-1).sum(axis=0) * parts.width / 3.0
        allowed = share * parts.width * (lower + chords.sum())
        wide = polygons - chords > allowed + _ROUNDING * polygons
        last = not wide.any() or 2 * np.count_nonzero(wide) > _MOST_PARTS
        settled = slice(None) if last else ~wide
        lower, upper = lower + float(chords[settled].sum()), upper + float(polygons[settled].sum())
        if last:
            return lower * (1.0 - _ROUNDING), upper * (1.0 + _ROUNDING)
        parts = parts.halved(wide)
