"""Line protocol between a computer and the motor board of a robot; docs/wheel-protocol.md."""

from __future__ import annotations

import binascii
from typing import NamedTuple

VERSION = 1
MAX_LINE = 512
"""Longest line, bytes; a longer one is discarded."""
MAX_WHEELS = 16
_COUNTS, _MICROSECONDS = 2**32, 2**32
"""Counts and stamps wrap at these values."""
_SEQUENCES = 2**16


class Hello(NamedTuple):
    """What a motor board says of itself."""

    version: int
    """Version of the protocol."""
    wheels: int
    """Number of wheels."""
    counts: int
    """Encoder counts per turn of a wheel."""
    watchdog: float
    """Time without a command after which it stops the motors, s."""


class Report(NamedTuple):
    """Encoder counts of a motor board."""

    sequence: int
    """Number of the report, modulo 2^16."""
    stamp: int
    """Time of the counts by the clock of the board, us, modulo 2^32."""
    acknowledged: int
    """Number of the last command that it executes, modulo 2^16."""
    counts: tuple[int, ...]
    """Count of each wheel, modulo 2^32 as a signed number; positive as in the wheel matrix."""


def hello_request() -> bytes:
    """Return the line that asks a board for :class:`Hello`."""
    return _line("H")


def command_line(sequence: int, speeds: tuple[float, ...]) -> bytes:
    """Return the line that commands wheel speeds, rad/s; signs of the wheel matrix."""
    return _line(f"W,{sequence % _SEQUENCES}," + ",".join(f"{speed:.4f}" for speed in speeds))


def parse(line: bytes) -> Hello | Report | None:
    """Return what a line of a board says; None: it is damaged, or of another kind."""
    fields = _fields(line)
    if fields is None or not all(map(_is_integer, fields[1:])):
        return None
    kind, numbers = fields[0], [int(field) for field in fields[1:]]
    if kind == "H" and len(numbers) == 4:
        version, wheels, counts, watchdog = numbers
        usable = 1 <= wheels <= MAX_WHEELS and 1 <= counts <= 10**9 and 0 <= watchdog <= 10**5
        return Hello(version, wheels, counts, 1e-3 * watchdog) if usable else None
    if kind == "E" and 4 <= len(numbers) <= 3 + MAX_WHEELS:
        sequence, stamp, acknowledged, *counted = numbers
        in_range = (
            0 <= sequence < _SEQUENCES
            and 0 <= acknowledged < _SEQUENCES
            and 0 <= stamp < _MICROSECONDS
            and all(-(_COUNTS // 2) <= count < _COUNTS // 2 for count in counted)
        )
        return Report(sequence, stamp, acknowledged, tuple(counted)) if in_range else None
    return None


def wrapped_difference(later: int, earlier: int, modulus: int) -> int:
    """Return the difference of two wrapping numbers that is smallest in magnitude."""
    return (later - earlier + modulus // 2) % modulus - modulus // 2


def count_difference(later: int, earlier: int) -> int:
    """Return the difference of two counts of an encoder."""
    return wrapped_difference(later, earlier, _COUNTS)


def stamp_difference(later: int, earlier: int) -> float:
    """Return the difference of two stamps of a board, s."""
    return 1e-6 * wrapped_difference(later, earlier, _MICROSECONDS)


def sequence_difference(later: int, earlier: int) -> int:
    """Return the difference of two numbers of lines."""
    return wrapped_difference(later, earlier, _SEQUENCES)


def _line(text: str) -> bytes:
    data = text.encode("ascii")
    return data + b"*%04X\n" % binascii.crc_hqx(data, 0xFFFF)


def _fields(line: bytes) -> list[str] | None:
    """Return the fields of a line whose checksum is right; None: it is not."""
    text, star, checksum = line.rstrip(b"\r\n").rpartition(b"*")
    if not star or len(line) > MAX_LINE or not text.isascii():
        return None
    if checksum != b"%04X" % binascii.crc_hqx(text, 0xFFFF):
        return None
    return text.decode("ascii").split(",")


def _is_integer(field: str) -> bool:
    return field.removeprefix("-").isdigit() and len(field) <= 12
