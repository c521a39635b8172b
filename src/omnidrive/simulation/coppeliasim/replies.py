"""What of a simulator's reply is looked at before anything is made of it."""

from __future__ import annotations

MAX_BYTES = 4 * 2**20
"""Longest reply: many times the list of all functions, which is the longest one asked for."""

_MAX_DEPTH = 64
_BREAK = 0xFF


def is_plain(raw: bytes) -> bool:
    """Whether ``raw`` is one well-formed item of CBOR (RFC 8949, appendix C), not nested deeply.

    Decoders in C recurse and reserve what a header announces: nesting and lengths that do not fit
    the message end the process.
    """
    try:
        return _after(raw) == len(raw)
    except (IndexError, ValueError):
        return False


def _after(raw: bytes) -> int:
    """Where the first item ends.

    Raises:
        IndexError: After the last byte.
        ValueError: There is none.
    """
    place = 0
    wanted: list[float] = [1]  # items still to come, per level; infinite until a break
    while wanted:
        if wanted[-1] == 0:
            wanted.pop()
            continue
        wanted[-1] -= 1
        head, place = raw[place], place + 1
        if head == _BREAK:
            if wanted[-1] != float("inf"):
                raise ValueError("a break where none belongs")
            wanted.pop()
            continue
        kind, size, place = _head(raw, head, place)
        if kind in {2, 3} and size != float("inf"):
            place += int(size)
        elif kind in {2, 3, 4}:
            wanted.append(size)
        elif kind == 5:
            wanted.append(2 * size)
        elif kind == 6:
            wanted.append(1)
        if place > len(raw) or len(wanted) > _MAX_DEPTH:
            raise ValueError("too short, or nested too deeply")
        if wanted[-1] != float("inf") and wanted[-1] > len(raw) - place:
            raise ValueError("more items than bytes")
    return place


def _head(raw: bytes, head: int, place: int) -> tuple[int, float, int]:
    """Kind of an item, its length or value, and where that ends."""
    kind, short = head >> 5, head & 31
    if short < 24:
        return kind, short, place
    if short == 31 and kind in {2, 3, 4, 5}:
        return kind, float("inf"), place
    if short > 27:
        raise ValueError("reserved")
    width = 1 << (short - 24)
    value = int.from_bytes(raw[place : place + width], "big")
    return kind, value, place + width
