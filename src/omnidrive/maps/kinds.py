"""What a file says of a cell: free, taken or unknown."""

from __future__ import annotations

from typing import Literal, get_args

from jaxtyping import Bool, UInt8

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.files.bounded_file import short_repr

Unknown = Literal["occupied", "free"]
"""What cells count as of which a file does not say whether they are free."""

FREE, TAKEN, UNKNOWN = range(3)


def occupied(kinds: UInt8[Array, "rows cols"], unknown: Unknown) -> Bool[Array, "rows cols"]:
    """Which cells are obstacles, unknown ones being what ``unknown`` says.

    Raises:
        InvalidInput: ``unknown`` is neither.
    """
    if unknown not in get_args(Unknown):
        raise InvalidInput(f"unknown cells can be 'occupied' or 'free', got {short_repr(unknown)}")
    taken: Bool[Array, "rows cols"] = (kinds != FREE) if unknown == "occupied" else (kinds == TAKEN)
    return taken
