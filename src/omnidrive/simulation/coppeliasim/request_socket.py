"""Requests over ZMTP 3.0, the protocol of ZeroMQ, with bounded memory and time.

libzmq receives all parts of a message before the program sees the first, and it limits the size of
a part but not their number: a peer can fill the memory. Here a reply is a single part, as the
remote API sends it, and every wait ends at a deadline. (rfc.zeromq.org/spec/23, mechanism NULL,
with the envelope of a REQ socket, rfc.zeromq.org/spec/28.)
"""

from __future__ import annotations

import socket
from time import monotonic

_MECHANISM = b"NULL".ljust(20, b"\0")
_SIGNATURE = b"\xff" + bytes(8) + b"\x7f"
_GREETING = _SIGNATURE + b"\x03\x00" + _MECHANISM + bytes(32)
_READY = b"\x05READY"
_METADATA = b"\x0bSocket-Type" + (3).to_bytes(4, "big") + b"REQ"
_MORE, _LONG, _COMMAND = 1, 2, 4  # flags of a frame
_MAX_COMMAND = 1000  # bytes
_CHUNK = 65_536  # bytes


class InvalidReply(Exception):
    """The peer does not follow the protocol, or its reply is too long."""


class RequestSocket:
    """A connection on which each request is followed by its reply.

    After any exception, including an interrupt, it can only be closed.

    Attributes:
        deadline: Time by :func:`time.monotonic` at which every wait ends, s.
    """

    def __init__(self, host: str, port: int, timeout: float, max_bytes: int) -> None:
        """Connect.

        Args:
            host: Name or address of the machine.
            port: TCP port.
            timeout: Longest wait for the connection, s.
            max_bytes: Length of the longest accepted reply.

        Raises:
            OSError: No program listens there.
        """
        self.deadline = monotonic() + timeout
        self._max_bytes = max_bytes
        self._received = bytearray()
        self._greeted = False
        self._socket = socket.create_connection((host, port), timeout)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, request: bytes) -> None:
        """Send a request.

        Raises:
            TimeoutError: The deadline has passed.
            OSError: The connection is lost.
            InvalidReply: The peer does not follow the protocol.
        """
        if not self._greeted:
            self._greet()
        self._write(_frame(_MORE, b"") + _frame(0, request))

    def receive(self) -> bytes:
        """Return the reply to the request.

        Raises:
            TimeoutError: The deadline has passed.
            OSError: The connection is lost.
            InvalidReply: The peer does not follow the protocol, or the reply is too long.
        """
        delimited = False
        while True:
            flags, body = self._read_frame()
            if flags & _COMMAND:  # such as of a heartbeat
                continue
            if delimited and not flags & _MORE:
                return body
            if delimited or not flags & _MORE or body:
                raise InvalidReply("its reply is not a single part")
            delimited = True

    def close(self) -> None:
        """Close the connection without a message to the peer."""
        self._socket.close()

    def _greet(self) -> None:
        """Exchange greetings and the types of the sockets."""
        self._write(_GREETING)
        signature = self._read(len(_SIGNATURE))
        if signature[0] != _SIGNATURE[0] or signature[-1] != _SIGNATURE[-1]:
            raise InvalidReply("it does not use ZeroMQ")
        rest = self._read(len(_GREETING) - len(_SIGNATURE))
        if rest[0] < _GREETING[len(_SIGNATURE)] or rest[2 : 2 + len(_MECHANISM)] != _MECHANISM:
            raise InvalidReply("it uses another version or the encryption of ZeroMQ")
        self._write(_frame(_COMMAND, _READY + _METADATA))
        flags, body = self._read_frame()
        if not (flags & _COMMAND and body.startswith(_READY)):
            raise InvalidReply("it refuses the connection")
        self._greeted = True

    def _read_frame(self) -> tuple[int, bytes]:
        """Return flags and body of the next frame."""
        (flags,) = self._read(1)
        size = int.from_bytes(self._read(8 if flags & _LONG else 1), "big")
        maximum = _MAX_COMMAND if flags & _COMMAND else self._max_bytes
        if flags > (_MORE | _LONG | _COMMAND):
            raise InvalidReply(f"it sends a frame with the reserved flags {flags:#04x}")
        if size > maximum:
            raise InvalidReply(f"it sends {size} bytes, more than {maximum}")
        return flags, self._read(size)

    def _read(self, count: int) -> bytes:
        """Return the next ``count`` bytes."""
        received = self._received
        while len(received) < count:
            self._socket.settimeout(self._remaining())
            chunk = self._socket.recv(_CHUNK)
            if not chunk:
                raise ConnectionError("the connection was closed")
            received += chunk
        data = bytes(received[:count])
        del received[:count]
        return data

    def _write(self, data: bytes) -> None:
        self._socket.settimeout(self._remaining())
        self._socket.sendall(data)

    def _remaining(self) -> float:
        """Return the time to the deadline, s."""
        remaining = self.deadline - monotonic()
        if remaining <= 0.0:
            raise TimeoutError
        return remaining


def _frame(flags: int, body: bytes) -> bytes:
    """Return a frame with its head."""
    if len(body) < 256:
        return bytes([flags, len(body)]) + body
    return bytes([flags | _LONG]) + len(body).to_bytes(8, "big") + body
