"""Messages as bytes: the encoding CDR (XCDR version 1) that ROS 2 nodes exchange and log.

A message of four bytes header, which names the encoding, and its fields in their order, each
aligned to its size from the end of the header; texts end with a zero byte, and their length and
that of sequences precede them as 32 bits (OMG DDS-XTypes 1.3, 7.4.3).
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from functools import cache
from itertools import groupby, islice
from typing import Any, Literal

import numpy as np

from omnidrive.errors import InvalidMessage, one_line, short_repr
from omnidrive.ros2.interface import LATEST, PRIMITIVES, Distribution, Field, interface
from omnidrive.ros2.message import Message, dtype_of, message_type
from omnidrive.ros2.type_hash import NO_FIELDS

MAX_BYTES = 1 << 28
"""Longest message that is decoded, in bytes: 256 MiB, a map of 16 000 times 16 000 cells."""
_LITTLE_ENDIAN, _BIG_ENDIAN = b"\x00\x01\x00\x00", b"\x00\x00\x00\x00"
_NATIVE = "<" if sys.byteorder == "little" else ">"
_COUNTS = {order: struct.Struct(order + "I") for order in "<>"}
_FAULTS = (struct.error, TypeError, ValueError, OverflowError, AttributeError)


def encode(message: Message, *, prefix: bytes = b"") -> bytes:
    """Return a message as bytes, little-endian, with the header of the encoding.

    Args:
        message: The message.
        prefix: Bytes between header and message, a multiple of eight, as requests have.

    Raises:
        InvalidMessage: A field holds something else than its type.
    """
    out = bytearray(prefix)
    try:
        _codec(message.interface.name, message.distribution).write(out, message)
    except _FAULTS as error:
        name = message.interface.name
        raise InvalidMessage(f"{name} cannot be encoded: {one_line(str(error), 160)}") from None
    return _LITTLE_ENDIAN + bytes(out)


def decode(
    data: bytes | memoryview, name: str, distribution: Distribution = LATEST, *, skip: int = 0
) -> Message:
    """Return the message that bytes hold.

    Lengths in the bytes are checked before anything is allocated: memory is at most a constant
    multiple of their number.

    Args:
        data: The bytes, with the header of the encoding.
        name: Full name of the type, such as ``nav_msgs/msg/Odometry``.
        distribution: Distribution whose definition holds.
        skip: Number of bytes between header and message, a multiple of eight.

    Raises:
        InvalidMessage: The bytes are not a message of this type.
        InvalidInput: There is no such type.
    """
    codec = _codec(name, distribution)
    head = bytes(data[:4])
    if head[:2] not in {_LITTLE_ENDIAN[:2], _BIG_ENDIAN[:2]} or len(head) < 4:
        raise InvalidMessage(f"not CDR: a message starts with {short_repr(head)}")
    if len(data) > MAX_BYTES:
        raise InvalidMessage(f"{name} of {len(data)} bytes, more than {MAX_BYTES}")
    source = _Source(memoryview(data)[4:], skip, "<" if head[1] else ">")
    try:
        message = codec.read(source)
    except _FAULTS as error:
        raise InvalidMessage(f"not a {name}: {one_line(str(error), 160)}") from None
    if len(source.data) - source.at > 3:
        raise InvalidMessage(f"not a {name}: {len(source.data) - source.at} bytes too many")
    return message


class _Source:
    """Bytes that are read, the position, and their byte order."""

    __slots__ = ("at", "data", "order")

    def __init__(self, data: memoryview, at: int, order: Literal["<", ">"]) -> None:
        self.data, self.at, self.order = data, at, order

    def count(self, minimum: int) -> int:
        """Read the length of a sequence whose elements have at least ``minimum`` bytes each."""
        at = (self.at + 3) & -4
        (length,) = _COUNTS[self.order].unpack_from(self.data, at)
        self.at = at + 4
        if length * minimum > len(self.data) - self.at:
            raise ValueError(f"a length of {length} with {len(self.data) - self.at} bytes left")
        return int(length)

    def text(self) -> str:
        """Read a text."""
        length = self.count(1)
        end = self.at + length
        raw = bytes(self.data[self.at : end])
        self.at = end
        if length and raw[-1]:
            raise ValueError("a text without its final zero")
        return raw[:-1].decode()


class _Run:
    """Consecutive fields of fixed size, also those of messages within: one ``struct``."""

    def __init__(self, fields: list[Field], distribution: Distribution) -> None:
        self.leaves = [_Leaf(field, distribution) for field in fields]
        self.codes = [code for leaf in self.leaves for code in leaf.codes]
        self.minimum = sum(struct.calcsize(code) for code, _ in self.codes)
        self._layouts: dict[tuple[str, int], struct.Struct] = {}

    def layout(self, order: str, at: int) -> struct.Struct:
        """Return the layout at a position, with the bytes that align each field."""
        key = order, at & 7
        found = self._layouts.get(key)
        if found is None:
            text, end = order, at & 7
            for code, alignment in self.codes:
                gap = -end % alignment
                text += "x" * gap + code
                end += gap + struct.calcsize(code)
            found = self._layouts[key] = struct.Struct(text)
        return found

    def write(self, out: bytearray, message: Message) -> None:
        """Append the bytes of the part of a message."""
        values: list[Any] = []
        for leaf in self.leaves:
            leaf.flatten(getattr(message, leaf.field.name), values)
        out += self.layout("<", len(out)).pack(*values)

    def read(self, source: _Source, values: list[Any]) -> None:
        """Append the values of the next bytes."""
        layout = self.layout(source.order, source.at)
        items = iter(layout.unpack_from(source.data, source.at))
        source.at += layout.size
        values += [leaf.build(items, source.order) for leaf in self.leaves]


class _Leaf:
    """A field of fixed size: a number, an array of numbers, or a message of such fields.

    Attributes:
        codes: Format and alignment of its items in a ``struct``; an array is one item, its bytes.
    """

    def __init__(self, field: Field, distribution: Distribution) -> None:
        self.field = field
        self.is_number = field.kind == "single" and "/" not in field.type
        self.parts: list[_Leaf] = []
        if "/" in field.type:
            self.cls = message_type(field.type, distribution)
            inner = self.cls.interface.fields or (NO_FIELDS,)
            self.parts = [_Leaf(each, distribution) for each in inner]
            self.empty = not self.cls.interface.fields
            self.plain = not self.empty and all(part.is_number for part in self.parts)
            self.codes: list[tuple[str, int]] = [code for part in self.parts for code in part.codes]
        else:
            self.dtype = dtype_of(field.type)
            size = self.dtype.itemsize
            code = f"{field.length * size}s" if field.kind == "array" else PRIMITIVES[field.type]
            self.codes = [(code, size)]

    def flatten(self, value: Any, values: list[Any]) -> None:
        """Append the items of a value."""
        if self.parts:
            _check_class(value, self.cls)
            if self.empty:
                values.append(0)
                return
            for part in self.parts:
                part.flatten(getattr(value, part.field.name), values)
        elif self.field.kind == "array":
            numbers = _checked_array(value, self.dtype)
            if len(numbers) != self.field.length:
                raise ValueError(f"{self.field.name} needs {self.field.length} values")
            values.append(_array_bytes(numbers))
        else:
            values.append(value)

    def build(self, items: Iterator[Any], order: str) -> Any:
        """Return the value of the next items."""
        if self.parts:
            if self.plain:
                return self.cls(*islice(items, len(self.parts)))
            inner = [part.build(items, order) for part in self.parts]
            return self.cls() if self.empty else self.cls(*inner)
        if self.field.kind == "array":
            return _numbers(next(items), self.dtype, order)
        return next(items)


class _Texts:
    """A text, or a sequence of texts."""

    minimum = 4

    def __init__(self, field: Field) -> None:
        self.name, self.single, self.bound = field.name, field.kind == "single", field.bound

    def write(self, out: bytearray, message: Message) -> None:
        """Append the bytes of the part of a message."""
        value = getattr(message, self.name)
        if not self.single:
            _write_count(out, len(value))
        for text in (value,) if self.single else value:
            _write_text(out, text, self.bound)

    def read(self, source: _Source, values: list[Any]) -> None:
        """Append the values of the next bytes."""
        if self.single:
            values.append(source.text())
        else:
            values.append([source.text() for _ in range(source.count(4))])


class _Numbers:
    """A sequence of numbers."""

    minimum = 4

    def __init__(self, field: Field) -> None:
        self.name, self.dtype = field.name, dtype_of(field.type)

    def write(self, out: bytearray, message: Message) -> None:
        """Append the bytes of the part of a message."""
        numbers = _checked_array(getattr(message, self.name), self.dtype)
        _write_count(out, len(numbers))
        if len(numbers):
            out += bytes(-len(out) % self.dtype.itemsize)
            out += _array_bytes(numbers)

    def read(self, source: _Source, values: list[Any]) -> None:
        """Append the values of the next bytes."""
        size = self.dtype.itemsize
        length = source.count(size)
        if length:
            source.at += -source.at % size
        raw = bytes(source.data[source.at : source.at + length * size])
        if len(raw) < length * size:
            raise ValueError("the bytes end within a sequence")
        source.at += len(raw)
        values.append(_numbers(raw, self.dtype, source.order))


class _Messages:
    """A sequence of messages, or a message that contains texts or sequences."""

    def __init__(self, field: Field, distribution: Distribution) -> None:
        self.name, self.single = field.name, field.kind == "single"
        self.codec = _codec(field.type, distribution)
        self.minimum: int = self.codec.minimum if self.single else 4

    def write(self, out: bytearray, message: Message) -> None:
        """Append the bytes of the part of a message."""
        value = getattr(message, self.name)
        if self.single:
            self.codec.write(out, value)
            return
        _write_count(out, len(value))
        for each in value:
            self.codec.write(out, each)

    def read(self, source: _Source, values: list[Any]) -> None:
        """Append the values of the next bytes."""
        read = self.codec.read
        if self.single:
            values.append(read(source))
        else:
            values.append([read(source) for _ in range(source.count(self.codec.minimum))])


_VariablePart = _Texts | _Numbers | _Messages
"""Encoder and decoder of one field of variable size."""


class _Codec:
    """Encoder and decoder of one type.

    Attributes:
        minimum: Smallest number of bytes of a message.
    """

    def __init__(self, name: str, distribution: Distribution) -> None:
        self.cls = message_type(name, distribution)
        self.empty = not self.cls.interface.fields
        self.parts: list[_Run | _VariablePart] = []
        fields = self.cls.interface.fields
        for fixed, group in groupby(fields, lambda field: _is_fixed(field, distribution)):
            if fixed:
                self.parts.append(_Run(list(group), distribution))
            else:
                self.parts += [_part(field, distribution) for field in group]
        self.minimum: int = 1 if self.empty else sum(part.minimum for part in self.parts)

    def write(self, out: bytearray, message: Message) -> None:
        """Append a message."""
        _check_class(message, self.cls)
        if self.empty:
            out.append(0)
        for part in self.parts:
            part.write(out, message)

    def read(self, source: _Source) -> Message:
        """Read a message."""
        if self.empty:
            struct.unpack_from("x", source.data, source.at)
            source.at += 1
            return self.cls()
        values: list[Any] = []
        for part in self.parts:
            part.read(source, values)
        return self.cls(*values)


_codec = cache(_Codec)


def _part(field: Field, distribution: Distribution) -> _VariablePart:
    """Return the encoder and decoder of a field of variable size."""
    if field.kind == "array":
        raise NotImplementedError(f"{field.name}: an array of {field.type}")
    if "/" in field.type:
        return _Messages(field, distribution)
    if field.type == "string":
        return _Texts(field)
    return _Numbers(field)


def _is_fixed(field: Field, distribution: Distribution) -> bool:
    """Return whether a field always has the same number of bytes."""
    if field.kind == "sequence" or field.type == "string":
        return False
    if field.type in PRIMITIVES:
        return True
    inner = interface(field.type, distribution).fields
    return field.kind == "single" and all(_is_fixed(each, distribution) for each in inner)


def _check_class(value: Any, cls: type[Message]) -> None:
    if type(value) is not cls and getattr(value, "interface", None) != cls.interface:
        raise TypeError(f"a {cls.interface.name} is needed, got {short_repr(value, 80)}")


def _checked_array(value: Any, dtype: np.dtype[Any]) -> np.ndarray:
    """Return a value as an array of numbers; raise ValueError if it changes them."""
    if type(value) is np.ndarray and value.dtype == dtype and value.ndim == 1:
        return value
    array = np.asarray(value)
    if array.ndim != 1:
        raise ValueError(f"an array of one dimension is needed, got {array.ndim}")
    with np.errstate(invalid="ignore", over="ignore"):
        converted = array.astype(dtype, copy=False)
    rounded = array.dtype.kind in "iuf" and dtype.kind == "f"
    if not (rounded or converted is array or np.array_equal(converted, array)):
        raise ValueError(f"numbers of the type {dtype} are needed")
    return converted


def _array_bytes(numbers: np.ndarray) -> bytes:
    """Return numbers as bytes, little-endian."""
    return (numbers if _NATIVE == "<" else numbers.byteswap()).tobytes()


def _numbers(raw: bytes, dtype: np.dtype[Any], order: str) -> np.ndarray:
    """Return the numbers that bytes in a byte order hold, as an array of its own."""
    if dtype.kind == "b":
        return np.frombuffer(raw, np.uint8).astype(dtype)
    numbers = np.frombuffer(raw, dtype)
    return numbers.copy() if order == _NATIVE else numbers.byteswap()


def _write_count(out: bytearray, count: int) -> None:
    out += bytes(-len(out) % 4)
    out += _COUNTS["<"].pack(count)


def _write_text(out: bytearray, text: str, bound: int) -> None:
    raw = text.encode()
    if b"\0" in raw:
        raise ValueError("a text with a zero byte")
    if bound and len(raw) > bound:
        raise ValueError(f"a text of {len(raw)} bytes, at most {bound}")
    _write_count(out, len(raw) + 1)
    out += raw
    out.append(0)
