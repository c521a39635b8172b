"""Link to a motor board that speaks the line protocol of wheel_protocol.py."""

from __future__ import annotations

import errno
import os
import select
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Protocol, runtime_checkable

from omnidrive.control import CommandValue, WheelSpeeds, WheelTorques
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import Clock, MonotonicClock
from omnidrive.deploy.links.wheel_counts import WheelCounts
from omnidrive.deploy.links.wheel_protocol import (
    MAX_LINE,
    VERSION,
    Hello,
    Report,
    command_line,
    hello_request,
    parse,
)
from omnidrive.deploy.links.writable import is_writable
from omnidrive.deploy.robot_link import LinkCapabilities, LinkLost
from omnidrive.errors import InvalidInput, MissingExtra, one_line
from omnidrive.estimation import SensorReadings
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Robot

_HELLO_TIME = 3.0  # s for the answer of the board
_HELLO_PERIOD = 0.2  # s between requests
_MAX_DATAGRAMS = 1000
_MAX_BYTES = 1 << 16  # bytes of one call of ``receive``: 1000 reports
_BAUD = 115_200
_UNPLUGGED = {
    errno.EAGAIN, errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ENETDOWN, errno.ENETUNREACH,
    errno.ENOBUFS,
}  # fmt: skip
"""Errors of a socket that pass when the network or the board is back."""


@runtime_checkable
class _Port(Protocol):
    """A channel of bytes that does not block."""

    def receive(self) -> bytes:
        """Return what has arrived; empty: nothing."""
        ...

    def send(self, data: bytes) -> None:
        """Send bytes."""
        ...

    def close(self) -> None:
        """Close the channel."""
        ...


class _Lines:
    """Lines of a stream of bytes."""

    def __init__(self) -> None:
        self._rest = b""

    def split(self, data: bytes) -> list[bytes]:
        """Return the lines that are complete with ``data``, but no empty or too long ones."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE:
            self._rest = b""
        return [line for line in lines if line.strip()]


@dataclass(slots=True)
class WheelsLink:
    """A motor board over UDP or a serial line: wheel speeds out, encoder counts in.

    It measures no pose: the estimator reckons from the encoders, from the start of the drive on.

    Attributes:
        robot: The robot; its wheels have the order of the board.
        address: ``udp://HOST:PORT``, or a serial port such as ``/dev/ttyACM0`` or
            ``/dev/ttyUSB0@57600`` (bits per second; default 115200).
        damaged: Number of lines with a wrong checksum or content.
    """

    robot: Robot
    address: str
    damaged: int = field(default=0, init=False)
    _clock: Clock = field(default_factory=MonotonicClock, init=False)
    _port: _Port | None = field(default=None, init=False)
    _lines: _Lines = field(default_factory=_Lines, init=False)
    _hello: Hello | None = field(default=None, init=False)
    _counts: WheelCounts | None = field(default=None, init=False)
    """Angles of the wheels; None before the board greets."""
    _sequence: int = field(default=0, init=False)
    _ask: float = field(default=0.0, init=False)
    """Time of the next request for a greeting, s."""

    def __post_init__(self) -> None:
        _opener(self.address)

    @property
    def capabilities(self) -> LinkCapabilities:
        """What the board said."""
        watchdog = self._hello.watchdog if self._hello else None
        return LinkCapabilities(watchdog, measures_pose=False, wheel_speeds=True)

    @property
    def lost(self) -> int:
        """Number of reports that did not arrive."""
        return self._counts.lost if self._counts else 0

    @property
    def fault(self) -> str:
        """Why no usable readings arrive; empty: not known."""
        return self._counts.fault if self._counts else ""

    def open(self, clock: Clock) -> None:
        """Connect and ask the board what it is.

        Raises:
            LinkLost: The port cannot be opened, no board answers, or it has another number of
                wheels or another version of the protocol.
            MissingExtra: A serial port needs pyserial, which is not installed.
        """
        self._clock = clock
        self._port = _opener(self.address)()
        try:
            self._greet(clock)
        except BaseException:
            self._port.close()
            self._port = self._hello = self._counts = None
            raise
        self.stop()

    def _greet(self, clock: Clock) -> None:
        """Ask the board what it is, and compare it with the robot."""
        self._ask = clock.now()
        give_up = self._ask + _HELLO_TIME
        while self._hello is None:
            now = clock.now()
            if now >= give_up:
                raise LinkLost(f"no motor board answers at {self.address} within {_HELLO_TIME:g} s")
            self._ask_for_greeting()
            self._receive()
            clock.sleep_until(now + 0.005)
        if self._hello.version != VERSION:
            raise LinkLost(f"the board speaks version {self._hello.version}, need {VERSION}")
        if self._hello.wheels != len(self.robot.mounts):
            raise LinkLost(
                f"the board has {self._hello.wheels} wheels, the robot {len(self.robot.mounts)}"
            )

    def _ask_for_greeting(self) -> None:
        """Ask the board what it is, unless that was a short time ago."""
        now = self._clock.now()
        if now >= self._ask:
            self._send(hello_request())
            self._ask = now + _HELLO_PERIOD

    def read(self) -> SensorReadings | None:
        """Return the wheel angles of the newest report since the last call.

        None: nothing new arrived, or it is not usable, see :attr:`fault`.
        """
        found, counts = self._receive(), self._counts
        if counts is None:
            return None
        if counts.needs_greeting:
            self._ask_for_greeting()
        usable = found and not counts.withheld
        return SensorReadings(counts.stamp, counts.angles) if usable else None

    def send(self, value: CommandValue) -> None:
        """Send wheel speeds.

        Raises:
            InvalidInput: The command is torques.
            LinkLost: The port failed.
        """
        if isinstance(value, WheelTorques):
            raise InvalidInput("a motor board takes wheel speeds, no torques")
        if isinstance(value, WheelSpeeds):
            speeds = tuple(value)
        else:
            speeds = tuple(self.robot.chassis.wheel_speeds(BodyTwist(*value)).tolist())
        if self._counts is not None:
            self._counts.command(speeds, self._clock.now())
        self._sequence += 1
        self._send(command_line(self._sequence, speeds))

    def stop(self) -> None:
        """Command zero speed."""
        with suppress(LinkLost):
            self.send(STOP)

    def close(self) -> None:
        """Stop the robot and close the port."""
        self.stop()
        if self._port is not None:
            self._port.close()
            self._port = None

    def _send(self, data: bytes) -> None:
        if self._port is None:
            raise LinkLost("the link is not open")
        try:
            self._port.send(data)
        except OSError as error:
            raise LinkLost(f"{self.address}: {error.strerror or error}") from None

    def _receive(self) -> bool:
        """Process what has arrived; return whether it held a new report."""
        if self._port is None:
            raise LinkLost("the link is not open")
        try:
            data = self._port.receive()
        except OSError as error:
            raise LinkLost(f"{self.address}: {error.strerror or error}") from None
        found, now = False, self._clock.now()
        for line in self._lines.split(data):
            said = parse(line)
            if isinstance(said, Hello) and self._counts is None:
                self._hello = said
                self._counts = WheelCounts(said, self.robot.max_wheel_speed)
            elif isinstance(said, Hello) and self._counts is not None:
                self._counts.greet(said, now)
            elif isinstance(said, Report) and self._counts is not None:
                found |= self._counts.take(said, now)
            elif said is None:
                self.damaged += 1
        return found


def _opener(address: str) -> Callable[[], _Port]:
    """Return a function that opens the port of an address.

    Raises:
        InvalidInput: The address has another form.
    """
    if address.startswith("udp://"):
        host, _, port = address.removeprefix("udp://").rpartition(":")
        host = host.removeprefix("[").removesuffix("]")  # of IPv6, as in a URL
        is_port = port.isascii() and port.isdigit() and len(port) <= 5 and 0 < int(port) < 2**16
        if not host or not is_port:
            raise InvalidInput(f"the address of a motor board is udp://HOST:PORT, got {address!r}")
        return lambda: _UdpPort(host, int(port))
    name, _, baud = address.partition("@")
    if not name.startswith(("/", "COM")) or (baud and not baud.isdigit()):
        raise InvalidInput(
            "the address of a motor board is udp://HOST:PORT or a serial port such as "
            f"/dev/ttyACM0@115200, got {address!r}"
        )
    return lambda: _serial_port(name, int(baud or _BAUD))


class _UdpPort:
    """A UDP socket that hears one peer only."""

    def __init__(self, host: str, port: int) -> None:
        try:
            family, kind, _, _, peer = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind)
            self._socket.connect(peer)
        except OSError as error:
            raise LinkLost(f"udp://{host}:{port}: {error.strerror or error}") from None
        except UnicodeError:
            raise LinkLost(f"udp://{host}:{port}: this is not the name of a host") from None
        self._socket.setblocking(False)

    def receive(self) -> bytes:
        """Return the datagrams that have arrived."""
        data = bytearray()
        for _ in range(_MAX_DATAGRAMS):
            if len(data) >= _MAX_BYTES or not select.select([self._socket], [], [], 0.0)[0]:
                break
            with _passing():
                data += self._socket.recv(4096)
        return bytes(data)

    def send(self, data: bytes) -> None:
        """Send one datagram; it is lost if no socket is open there or the network is down."""
        with _passing():
            self._socket.send(data)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


@contextmanager
def _passing() -> Iterator[None]:
    """Ignore errors of a socket that mean a lost datagram."""
    try:
        yield
    except OSError as error:
        if error.errno not in _UNPLUGGED:
            raise


def _serial_port(name: str, baud: int) -> _Port:
    try:
        serial: Any = import_module("serial")
    except ModuleNotFoundError:
        raise MissingExtra(
            "a serial port needs pyserial, which is not installed: pip install pyserial"
        ) from None
    try:
        opened = serial.Serial(name, baud, timeout=0, write_timeout=0, exclusive=True)
    except (OSError, ValueError) as error:
        number = getattr(error, "errno", None)
        reason = os.strerror(number) if number else one_line(str(error))
        raise LinkLost(f"the serial port {name} cannot be opened: {reason}") from None
    return _SerialPort(opened)


class _SerialPort:
    """A serial line of pyserial, opened for this process alone."""

    def __init__(self, opened: Any) -> None:
        self._serial = opened

    def receive(self) -> bytes:
        """Return what has arrived."""
        data: bytes = self._serial.read(_MAX_BYTES)
        return data

    def send(self, data: bytes) -> None:
        """Send bytes; they are lost while the board takes none, because ``write`` would wait."""
        if is_writable(self._serial):
            self._serial.write(data)

    def close(self) -> None:
        """Close the port."""
        self._serial.close()
