"""Validation of CBOR messages before they are decoded."""

from __future__ import annotations

MAX_BYTES = 2**20
"""Longest reply, bytes: many times the list of all functions, the longest regular reply."""
MAX_ITEMS = 50_000
"""Largest number of items in a reply; the list of all functions has about 10,000."""

_MAX_DEPTH = 64
_BREAK = 0xFF


def is_harmless(raw: bytes) -> bool:
    """Return whether ``raw`` is one well-formed CBOR item (RFC 8949, appendix C) within bounds.

    Decoders in C are recursive and allocate the length that a header states: deep nesting, or
    lengths beyond the message, can crash the process. Many small items take many times the memory
    of the message, and the time to decode some tagged ones, such as fractions, is not bounded: the
    remote API uses none.
    """
    try:
        return _item_end(raw) == len(raw)
    except (IndexError, ValueError):
        return False


def _item_end(raw: bytes) -> int:
    """Return the offset after the first item.

    Raises:
        IndexError: The item continues after the last byte.
        ValueError: The item is not well-formed or not within the bounds.
    """
    position, items = 0, 0
    remaining: list[float] = [1]  # items left on each level; infinite until a break
    while remaining:
        if remaining[-1] == 0:
            remaining.pop()
            continue
        remaining[-1] -= 1
        items += 1
        head, position = raw[position], position + 1
        if head == _BREAK:
            if remaining[-1] != float("inf"):
                raise ValueError("unexpected break")
            remaining.pop()
            continue
        kind, size, position = _head(raw, head, position)
        if kind in {2, 3} and size != float("inf"):
            position += int(size)
        elif kind in {2, 3, 4}:
            remaining.append(size)
        elif kind == 5:
            remaining.append(2 * size)
        elif kind == 6:
            raise ValueError("tagged")
        if position > len(raw) or len(remaining) > _MAX_DEPTH or items > MAX_ITEMS:
            raise ValueError("truncated, nested too deeply, or too many items")
        if remaining[-1] != float("inf") and remaining[-1] > len(raw) - position:
            raise ValueError("more items than bytes")
    return position


def _head(raw: bytes, head: int, position: int) -> tuple[int, float, int]:
    """Return the major type of an item, its length or value, and the offset after its head."""
    kind, short = head >> 5, head & 31
    if short < 24:
        return kind, short, position
    if short == 31 and kind in {2, 3, 4, 5}:
        return kind, float("inf"), position
    if short > 27:
        raise ValueError("reserved length")
    width = 1 << (short - 24)
    value = int.from_bytes(raw[position : position + width], "big")
    return kind, value, position + width
