"""One MCAP file of a drive."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from omnidrive.deploy.log.logged_event import EVENT_TYPE
from omnidrive.deploy.log.logged_sample import SAMPLE_TYPE
from omnidrive.deploy.log.viewer_messages import TOPICS
from omnidrive.errors import MissingExtra
from omnidrive.files.output_file import write_errors
from omnidrive.ros2.cdr import encode
from omnidrive.ros2.interface import LATEST, definition_text
from omnidrive.ros2.message import message_type
from omnidrive.ros2.type_hash import type_hash

SAMPLES, EVENTS = "/drive/samples", "/drive/events"
"""Topics from which a drive is read again."""
DESCRIPTION, END = "omnidrive.drive", "omnidrive.end"
"""Names of the metadata at the begin and at the end of a log."""
_CHUNK = 1 << 23  # bytes; chunks are closed by time before they reach it


def mcap_module(name: str) -> ModuleType:
    """Return a module of the package mcap.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return import_module(f"mcap.{name}")
    except ModuleNotFoundError:
        raise MissingExtra(
            "the log of a drive needs the package mcap, which is not installed: "
            "pip install mcap, or drive without a log"
        ) from None


class LogFile:
    """An MCAP file of messages of ROS (profile ``ros2``), which is readable at any time.

    Bytes reach the file in whole chunks. What the file holds is readable without its end, so that
    nothing is lost if the process is killed, except the chunk that is not closed.

    Args:
        path: The file; an existing one is overwritten.
        description: Metadata of the drive.
        files: Contents of the files that describe the drive, by name; they are attached.

    Raises:
        MissingExtra: The package mcap is not installed.
        CannotWrite: The file cannot be written.
    """

    def __init__(
        self, path: Path, description: Mapping[str, str], files: Mapping[str, bytes]
    ) -> None:
        library = mcap_module("writer")
        with write_errors(path):
            self._stream = _WholeParts(path)
        self._mcap: Any = library.Writer(self._stream, chunk_size=_CHUNK)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self.path = path
        with write_errors(path):
            self._mcap.start(profile="ros2", library="omnidrive")
            self._mcap.add_metadata(DESCRIPTION, dict(description))
            for name, data in files.items():
                self.attach(name, data)
            self._mcap.flush()

    @property
    def size(self) -> int:
        """Size of the file, bytes."""
        return self._stream.whole

    def add(self, topic: str, time: int, data: bytes) -> None:
        """Append an encoded message to the present chunk; ``time``: ns since 1970."""
        channel = self._channels.get(topic) or self._register(topic)
        self._mcap.add_message(channel, log_time=time, data=data, publish_time=time)

    def attach(self, name: str, data: bytes) -> None:
        """Attach a file."""
        self._mcap.add_attachment(0, 0, name, _media_type(name), data)

    def _register(self, topic: str) -> int:
        name = TOPICS.get(topic) or (SAMPLE_TYPE if topic == SAMPLES else EVENT_TYPE)
        if name not in self._schemas:
            self._schemas[name] = self._mcap.register_schema(name, "ros2msg", _schema(name))
        about = {"offered_qos_profiles": "", "topic_type_hash": type_hash(name, LATEST)}
        self._channels[topic] = self._mcap.register_channel(
            topic, "cdr", self._schemas[name], about
        )
        return self._channels[topic]

    def flush(self) -> None:
        """Close the present chunk and pass it to the operating system.

        Raises:
            OSError: It cannot be written; the file ends with the chunk before.
        """
        self._mcap.flush()

    def end(self, summary: Mapping[str, str]) -> None:
        """Write the end of the file with its index, and close it.

        Raises:
            OSError: They cannot be written; the file ends as after :meth:`abandon`.
        """
        try:
            self._mcap.flush()
            self._mcap.add_metadata(END, dict(summary))
            self._mcap.finish()
            self._stream.flush()
        except OSError:
            self.abandon()
            raise
        self._stream.close()

    def abandon(self) -> None:
        """End the file without an index after the last chunk that was written, and close it."""
        if self._stream.closed:
            return
        records, streams = mcap_module("records"), mcap_module("data_stream")
        end = streams.RecordBuilder()
        records.DataEnd(0).write(end)
        records.Footer(0, 0, 0).write(end)
        with suppress(OSError):
            self._stream.write(end.end() + mcap_module("writer").MCAP0_MAGIC)
            self._stream.flush()
        self._stream.close()


def warm_up() -> None:
    """Prepare the encoders and definitions of all messages, so that the first samples need not."""
    for name in {*TOPICS.values(), SAMPLE_TYPE, EVENT_TYPE}:
        encode(message_type(name)())
        _schema(name)
        type_hash(name, LATEST)


@cache
def _schema(name: str) -> bytes:
    return definition_text(name).encode()


class _WholeParts:
    """A file that receives everything between two calls of :meth:`flush`, or nothing of it.

    Attributes:
        whole: Number of bytes in the file.
        closed: Whether it is closed.
    """

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | _BINARY, 0o666)
        self._parts: list[bytes] = []
        self._waiting = 0
        self.whole = 0
        self.closed = False

    def write(self, data: bytes) -> None:
        """Append bytes."""
        self._parts.append(bytes(data))
        self._waiting += len(data)

    def tell(self) -> int:
        """Return the number of bytes so far."""
        return self.whole + self._waiting

    def flush(self) -> None:
        """Write the bytes; raise OSError without a trace in the file if that fails."""
        data = memoryview(b"".join(self._parts))
        self._parts, self._waiting = [], 0
        done = 0
        try:
            while done < len(data):
                done += os.write(self._descriptor, data[done:])
        except OSError:
            os.ftruncate(self._descriptor, self.whole)
            os.lseek(self._descriptor, self.whole, os.SEEK_SET)
            raise
        self.whole += done

    def close(self) -> None:
        """Close the file."""
        self.closed = True
        os.close(self._descriptor)


_BINARY = getattr(os, "O_BINARY", 0)


def _media_type(name: str) -> str:
    return "application/yaml" if name.endswith((".yaml", ".yml")) else "application/octet-stream"
