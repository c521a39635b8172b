"""Kinds of cells in map files: free, occupied or unknown."""

from __future__ import annotations

from typing import get_args

from jaxtyping import Bool, UInt8

from omnidrive.arrays import Array
from omnidrive.choices import Unknown
from omnidrive.parameter import check_choice

FREE, OCCUPIED, UNKNOWN = range(3)


def check_unknown(unknown: str) -> None:
    """Raise InvalidInput unless ``unknown`` is "occupied" or "free"."""
    check_choice("treatment of unknown cells", unknown, get_args(Unknown))


def occupied(kinds: UInt8[Array, "rows cols"], unknown: Unknown) -> Bool[Array, "rows cols"]:
    """Return the occupancy of cells, with unknown cells treated as ``unknown``."""
    mask: Bool[Array, "rows cols"] = (
        (kinds != FREE) if unknown == "occupied" else (kinds == OCCUPIED)
    )
    return mask
