"""Kinds of cells in map files: free, occupied or unknown."""

from __future__ import annotations

from typing import get_args

from jaxtyping import Bool, UInt8

from omnidrive.arrays import Array
from omnidrive.choices import Unknown
from omnidrive.errors import InvalidInput
from omnidrive.files.bounded_file import short_repr

FREE, OCCUPIED, UNKNOWN = range(3)


def occupied(kinds: UInt8[Array, "rows cols"], unknown: Unknown) -> Bool[Array, "rows cols"]:
    """Return the occupancy of cells, with unknown cells treated as ``unknown``.

    Raises:
        InvalidInput: ``unknown`` is neither "occupied" nor "free".
    """
    if unknown not in get_args(Unknown):
        raise InvalidInput(
            f"unknown cells can count as 'occupied' or 'free', got {short_repr(unknown)}"
        )
    mask: Bool[Array, "rows cols"] = (
        (kinds != FREE) if unknown == "occupied" else (kinds == OCCUPIED)
    )
    return mask
