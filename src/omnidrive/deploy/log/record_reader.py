"""Records of MCAP files that may be damaged or hostile."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from struct import Struct
from typing import Any, BinaryIO, NamedTuple

from omnidrive.deploy.log.log_file import mcap_module
from omnidrive.errors import InvalidLog, one_line
from omnidrive.files.bounded_file import open_file

MAX_RECORD = 1 << 26
"""Largest record and largest chunk, also decompressed, bytes: 64 MiB."""
MAX_EXPANSION = 200
"""Largest ratio of the content of a chunk to its compressed size, beyond 64 kB; so that the number
of records, and the time to read them, is proportional to the size of the file."""
_SMALL_CHUNK = 1 << 16  # bytes
_MAGIC = b"\x89MCAP0\r\n"
_HEAD = Struct("<BQ")
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 1, 2, 3, 4, 5, 6
_ATTACHMENT, _METADATA, _DATA_END = 9, 12, 15
_PARSERS = {
    _HEADER: "Header",
    _SCHEMA: "Schema",
    _CHANNEL: "Channel",
    _ATTACHMENT: "Attachment",
    _METADATA: "Metadata",
    _CHUNK: "Chunk",
    _DATA_END: "DataEnd",
}
_MESSAGE_HEAD = Struct("<HIQQ")
_SUMMARY = {_FOOTER, _DATA_END}


class LoggedMessage(NamedTuple):
    """One message of a file."""

    channel: int
    """Number of its channel."""
    time: int
    """Time, ns."""
    data: bytes
    """Encoded message."""


def read_records(path: Path) -> Iterator[Any]:
    """Yield the records of an MCAP file up to its summary: those of the package mcap, and messages.

    A file that ends early, as after ``kill -9``, is read up to its last complete chunk; the last
    item is a ``DataEnd`` only if it has its end. Memory is bounded by :data:`MAX_RECORD`, time by
    the size of the file times :data:`MAX_EXPANSION`.

    Args:
        path: The file.

    Raises:
        InvalidLog: It cannot be read or is no MCAP file, or a complete record is damaged.
        MissingExtra: The package mcap is not installed.
    """
    records = mcap_module("records")
    name = one_line(str(path))
    with open_file(path, "log", InvalidLog) as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise InvalidLog(f"{name} is not an MCAP file: its first bytes are others")
        try:
            yield from _records(file, records)
        except InvalidLog as error:
            raise InvalidLog(f"{name}: {error}") from None


def _records(file: BinaryIO, records: Any) -> Iterator[Any]:
    while True:
        at = file.tell()
        head = file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            return
        kind, length = _HEAD.unpack(head)
        if length > MAX_RECORD:
            raise InvalidLog(f"a record of {length} bytes at byte {at}, at most {MAX_RECORD}")
        data = file.read(length)
        if len(data) < length:
            return
        if kind in _SUMMARY:
            if kind == _DATA_END:
                yield _parsed(records, kind, data, at)
            return
        if kind == _CHUNK:
            yield from _in_chunk(records, _parsed(records, kind, data, at), at)
        elif kind in _PARSERS:
            yield _parsed(records, kind, data, at)


def _parsed(records: Any, kind: int, data: bytes, at: int) -> Any:
    """Return a record of the package mcap."""
    stream = mcap_module("data_stream").ReadDataStream(BytesIO(data))
    try:
        record = getattr(records, _PARSERS[kind]).read(stream)
    except Exception as error:
        what = one_line(str(error)) or type(error).__name__
        raise InvalidLog(f"damaged {_PARSERS[kind].lower()} at byte {at}: {what}") from None
    if kind == _ATTACHMENT and zlib.crc32(data[:-4]) != int.from_bytes(data[-4:], "little"):
        raise InvalidLog(f"damaged attachment at byte {at}: its checksum is another one")
    return record


def _in_chunk(records: Any, chunk: Any, at: int) -> Iterator[Any]:
    """Yield schemas, channels and messages of a chunk."""
    data = _decompressed(chunk, at)
    position = 0
    while position < len(data):
        if position + _HEAD.size > len(data):
            raise InvalidLog(f"the chunk at byte {at} ends within a record")
        kind, length = _HEAD.unpack_from(data, position)
        if kind == 0:
            raise InvalidLog(f"the chunk at byte {at} has a record of the invalid kind 0")
        begin = position + _HEAD.size
        position = begin + length
        if position > len(data):
            raise InvalidLog(f"the chunk at byte {at} ends within a record")
        if kind == _MESSAGE:
            if length < _MESSAGE_HEAD.size:
                raise InvalidLog(f"the chunk at byte {at} has a message of {length} bytes")
            channel, _, time, _ = _MESSAGE_HEAD.unpack_from(data, begin)
            yield LoggedMessage(channel, time, data[begin + _MESSAGE_HEAD.size : position])
        elif kind in {_SCHEMA, _CHANNEL}:
            yield _parsed(records, kind, data[begin:position], at)


def _decompressed(chunk: Any, at: int) -> bytes:
    """Return the content of a chunk, at most :data:`MAX_RECORD` bytes."""
    size = chunk.uncompressed_size
    if size > MAX_RECORD:
        raise InvalidLog(f"the chunk at byte {at} holds {size} bytes, at most {MAX_RECORD}")
    if size > max(MAX_EXPANSION * len(chunk.data), _SMALL_CHUNK):
        raise InvalidLog(
            f"the chunk at byte {at} expands from {len(chunk.data)} to {size} bytes, at most "
            f"{MAX_EXPANSION} times"
        )
    if chunk.compression not in {"", "zstd", "lz4"}:
        kind = one_line(chunk.compression, 20)
        raise InvalidLog(f"the chunk at byte {at} is compressed by {kind}, which is not known")
    try:
        data: bytes = _DECOMPRESSORS[chunk.compression](chunk.data, size)
    except Exception as error:
        raise InvalidLog(f"damaged chunk at byte {at}: {one_line(str(error), 100)}") from None
    if len(data) != size:
        raise InvalidLog(f"the chunk at byte {at} does not hold {size} bytes as it says")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise InvalidLog(f"damaged chunk at byte {at}: its checksum is another one")
    return data


def _from_zstd(data: bytes, size: int) -> bytes:
    """Return at most ``size`` + 1 bytes, whatever the data says about their number."""
    import zstandard  # noqa: PLC0415 - comes with mcap, an extra

    window = MAX_RECORD.bit_length() - 1
    options = zstandard.ZstdDecompressor(max_window_size=1 << window)
    with options.stream_reader(BytesIO(data)) as reader:
        return bytes(reader.read(size + 1))


def _from_lz4(data: bytes, size: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - comes with mcap, an extra

    return bytes(LZ4FrameDecompressor().decompress(data, max_length=size + 1))


_DECOMPRESSORS: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda data, _: data,
    "zstd": _from_zstd,
    "lz4": _from_lz4,
}
