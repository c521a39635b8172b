"""Link to a LeKiwi, through the host program of LeRobot: JSON over ZeroMQ."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from math import degrees, pi, radians, remainder
from typing import Any, NamedTuple

import numpy as np

from omnidrive.control import CommandValue, WheelSpeeds, WheelTorques
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import Clock, MonotonicClock
from omnidrive.deploy.robot_link import LinkCapabilities, LinkLost
from omnidrive.errors import InvalidInput, MissingExtra
from omnidrive.estimation import SensorReadings
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Chassis, Robot

WATCHDOG = 0.5
"""Time without a command after which the host stops the wheels, s (``watchdog_timeout_ms``)."""
MAX_WHEEL_SPEED = 3000 * 2.0 * pi / 4096
"""Speed of a wheel at which the host scales all wheels down, rad/s: 3000 of 4096 steps a turn."""
BEARINGS = (pi / 3.0, pi, -pi / 3.0)
"""Bearings of the wheels left, back and right, rad."""
_CHASSIS = Chassis.omni(
    angles=BEARINGS, ring_radius=0.125, wheel_radius=0.05, max_wheel_speed=MAX_WHEEL_SPEED
)
"""The robot as the host calculates with it: ``LeKiwi._body_to_wheel_raw`` of LeRobot."""
_INVERSE = np.linalg.inv(_CHASSIS.jacobian)
_FASTEST = 2**15 * 2.0 * pi / 4096  # rad/s; a servo reports 16 bits with a sign
_VELOCITIES = ("x.vel", "y.vel", "theta.vel")
_ARM_SUFFIX = ".pos"
_MAX_JOINTS, _MAX_KEY, _LARGEST = 32, 64, 1e5
_MAX_FRAME = 1_000_000  # bytes of one part of a message; an image has about 100,000
_MAX_PARTS = 16  # of a message: the observation, and an image of each camera
_MAX_BYTES = 4_000_000  # of a message
_MAX_WAITING = 32  # observations that wait until they are read
_PATIENCE = 1.0
"""Time without a whole message after which the connection is replaced, s: ZeroMQ keeps the parts of
a message until its last one, however many there are."""
_CONNECT_TIME = 5.0  # s, as LeRobot's client
_PING_PERIOD, _PING_TIMEOUT = 100, 500  # ms
_LAST_COMMAND = 0.1  # s; three periods of the host
_TURN_TOLERANCE = 0.1  # rad


class Observation(NamedTuple):
    """What a host reports of its robot."""

    twist: BodyTwist
    """Body twist from the measured speeds of the wheels, in B; m/s, m/s, rad/s."""
    arm: dict[str, float]
    """Position of each joint of the arm, by its key; degrees or percent, as the host is set up."""


def parse_observation(data: bytes) -> Observation | None:
    """Return the observation in the first part of a host's message; None: it is not usable.

    Images, which older hosts put into the same object, are ignored.
    """
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict):
        return None
    arm = {key: value for key, value in found.items() if key.endswith(_ARM_SUFFIX)}
    velocities = _numbers([found.get(key) for key in _VELOCITIES])
    positions = _numbers(list(arm.values()))
    if velocities is None or positions is None:
        return None
    if len(arm) > _MAX_JOINTS or any(len(key) > _MAX_KEY for key in arm):
        return None
    vx, vy, turn = velocities
    twist = BodyTwist(vx, vy, radians(turn))
    if np.abs(_CHASSIS.wheel_speeds(twist)).max() > _FASTEST:
        return None
    return Observation(twist, dict(zip(arm, positions, strict=True)))


def action(arm: dict[str, float], twist: BodyTwist) -> bytes:
    """Return the message that commands a body twist (B; m/s, m/s, rad/s) and the arm's joints."""
    values = (twist.vx, twist.vy, degrees(twist.yaw_rate))
    return json.dumps({**arm, **dict(zip(_VELOCITIES, values, strict=True))}).encode()


def _numbers(values: Sequence[object]) -> list[float] | None:
    """Return numbers as float; None: one is none, not finite, or larger than 1e5."""
    numbers = [v for v in values if isinstance(v, int | float) and not isinstance(v, bool)]
    if len(numbers) < len(values) or not all(abs(number) <= _LARGEST for number in numbers):
        return None
    return [float(number) for number in numbers]


@dataclass(slots=True)
class LeKiwiLink:
    """A LeKiwi through LeRobot's host: wheel speeds out, wheel speeds in.

    The host reports velocities and no pose: the link integrates the speeds of the wheels between
    the arrivals of observations, and the estimator reckons from the start of the drive on. The host
    executes only commands that also name positions of the arm; the link names those of its first
    observation, so that the arm holds still. Images are received and discarded.

    Attributes:
        robot: The robot; its wheels are left, back and right. Its radii may be calibrated: the link
            converts between its wheel speeds and the twists of the host, which calculates with
            wheels of 0.05 m on a circle of 0.125 m.
        host: Name or address of the computer on the robot.
        command_port: TCP port of commands.
        observation_port: TCP port of observations.
        damaged: Number of messages that were no usable observations.

    Raises:
        InvalidInput: The robot has other wheels, or the address has another form.
    """

    robot: Robot
    host: str
    command_port: int = 5555
    observation_port: int = 5556
    damaged: int = field(default=0, init=False)
    _clock: Clock = field(default_factory=MonotonicClock, init=False)
    _zmq: Any = field(default=None, init=False)
    _context: Any = field(default=None, init=False)
    _commands: Any = field(default=None, init=False)
    _observations: Any = field(default=None, init=False)
    _arm: dict[str, float] = field(default_factory=dict, init=False)
    """Positions of the arm, which all commands repeat."""
    _speeds: tuple[float, ...] = field(default=(0.0, 0.0, 0.0), init=False)
    """Speed of each wheel in the last observation, rad/s."""
    _angles: tuple[float, ...] = field(default=(0.0, 0.0, 0.0), init=False)
    """Angle of each wheel since the first observation, rad."""
    _is_damaged: bool = field(default=False, init=False)
    """Whether the last message was no usable observation."""
    _heard: float = field(default=0.0, init=False)
    """Arrival of the last whole message, or begin of the connection, s."""
    _stamp: float | None = field(default=None, init=False)
    """Arrival of the last observation, s."""

    def __post_init__(self) -> None:
        _check_wheels(self.robot)
        if not self.host or not all(c.isalnum() or c in ".-_:[]%" for c in self.host):
            raise InvalidInput(f"{self.host!r} is neither the name nor the address of a computer")
        for port in (self.command_port, self.observation_port):
            if not 0 < port < 2**16:
                raise InvalidInput(f"a port is a number from 1 to 65535, got {port}")

    @property
    def capabilities(self) -> LinkCapabilities:
        """What the host supports."""
        return LinkCapabilities(WATCHDOG, measures_pose=False, wheel_speeds=True)

    @property
    def fault(self) -> str:
        """Why no usable readings arrive; empty: not known."""
        return "what the host sends is no usable observation" if self._is_damaged else ""

    def open(self, clock: Clock) -> None:
        """Connect and wait for the first observation.

        Raises:
            LinkLost: No host sends observations there.
            MissingExtra: pyzmq is not installed.
        """
        self._clock = clock
        try:
            self._zmq = import_module("zmq")
        except ModuleNotFoundError:
            raise MissingExtra(
                "a LeKiwi needs pyzmq, which is not installed: pip install pyzmq"
            ) from None
        try:
            self._connect()
            self._wait(clock)
        except BaseException:
            self._disconnect()
            raise
        self.stop()

    def _connect(self) -> None:
        """Open both sockets. Neither keeps messages for a host that is away."""
        zmq = self._zmq
        self._context = zmq.Context()
        self._commands = self._context.socket(zmq.PUSH)
        self._commands.setsockopt(zmq.CONFLATE, 1)
        self._commands.setsockopt(zmq.IMMEDIATE, 1)
        self._connect_to(self._commands, self.command_port)
        self._connect_observations()

    def _connect_observations(self) -> None:
        """Open the socket of the observations; one that is open is closed, with what it holds."""
        zmq = self._zmq
        if self._observations is not None:
            self._observations.close()
        self._observations = self._context.socket(zmq.PULL)
        # newer hosts send images as further parts, which CONFLATE would tear apart
        self._observations.setsockopt(zmq.RCVHWM, _MAX_WAITING)
        self._observations.setsockopt(zmq.MAXMSGSIZE, _MAX_FRAME)
        self._connect_to(self._observations, self.observation_port)
        self._heard = self._clock.now()

    def _connect_to(self, socket: Any, port: int) -> None:
        zmq = self._zmq
        socket.setsockopt(zmq.LINGER, 0)
        # a connection without answers is closed, with the commands that wait in it
        socket.setsockopt(zmq.HEARTBEAT_IVL, _PING_PERIOD)
        socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, _PING_TIMEOUT)
        socket.setsockopt(zmq.RECONNECT_IVL, _PING_PERIOD)
        try:
            socket.connect(f"tcp://{self.host}:{port}")
        except zmq.ZMQError as error:
            raise LinkLost(f"tcp://{self.host}:{port}: {error.strerror}") from None

    def _wait(self, clock: Clock) -> None:
        """Wait for an observation with the positions of the arm."""
        place = f"tcp://{self.host}:{self.observation_port}"
        give_up = clock.now() + _CONNECT_TIME
        while not self._arm:
            found = self._receive()
            if found is not None:
                self._arm = found.arm
            elif clock.now() >= give_up:
                raise LinkLost(
                    f"what arrives from {place} is no observation of a LeKiwi"
                    if self.damaged
                    else f"no LeKiwi host sends observations at {place} within "
                    f"{_CONNECT_TIME:g} s; start it on the robot: "
                    "python -m lerobot.robots.lekiwi.lekiwi_host"
                )
            clock.sleep_until(clock.now() + 0.005)

    def read(self) -> SensorReadings | None:
        """Return the wheel angles at the newest observation since the last call."""
        found = self._receive()
        if found is None:
            return None
        now = self._clock.now()
        speeds = tuple(_CHASSIS.wheel_speeds(found.twist).tolist())
        if self._stamp is not None:
            passed = now - self._stamp
            # after a silence: the wheels went on until the watchdog stopped them
            weights = (0.5, 0.5) if passed <= WATCHDOG else (WATCHDOG / passed, 0.0)
            self._angles = tuple(
                angle + passed * (weights[0] * before + weights[1] * speed)
                for angle, before, speed in zip(self._angles, self._speeds, speeds, strict=True)
            )
        self._stamp, self._speeds = now, speeds
        return SensorReadings(now, self._angles)

    def _receive(self) -> Observation | None:
        """Return the newest observation that has arrived; older ones are discarded."""
        if self._observations is None:
            raise LinkLost("the link is not open")
        zmq, newest = self._zmq, None
        for _ in range(_MAX_WAITING):
            try:
                newest = self._message()
            except zmq.Again:
                break
            except zmq.ZMQError as error:
                raise LinkLost(f"{self.host}: {error.strerror}") from None
            if not newest:
                break
        if newest:
            self._heard = self._clock.now()
        elif newest is not None or self._clock.now() - self._heard > _PATIENCE:
            self._connect_observations()
        if newest is None:
            return None
        found = parse_observation(newest)
        self._is_damaged = found is None or not (self._arm or found.arm)
        self.damaged += self._is_damaged
        return None if self._is_damaged else found

    def _message(self) -> bytes:
        """Return the first part of the next message; empty if the message is too large.

        The rest of such a message is not read: the connection has to be replaced.

        Raises:
            zmq.Again: None has arrived.
        """
        zmq, socket = self._zmq, self._observations
        frame = socket.recv(zmq.NOBLOCK, copy=False)
        first: bytes = frame.bytes
        parts, size = 1, len(first)
        while frame.more:
            frame = socket.recv(zmq.NOBLOCK, copy=False)
            parts, size = parts + 1, size + len(frame)
            if parts > _MAX_PARTS or size > _MAX_BYTES:
                return b""
        return first

    def send(self, value: CommandValue) -> None:
        """Send a twist of the host; without a connection it is dropped.

        Raises:
            InvalidInput: The command is torques.
            LinkLost: The socket failed.
        """
        if isinstance(value, WheelTorques):
            raise InvalidInput("a LeKiwi takes wheel speeds, no torques")
        if self._commands is None:
            raise LinkLost("the link is not open")
        speeds = (
            np.array(value)
            if isinstance(value, WheelSpeeds)
            else self.robot.chassis.wheel_speeds(BodyTwist(*value))
        )
        data = action(self._arm, BodyTwist(*(_INVERSE @ speeds).tolist()))
        try:
            self._commands.send(data, self._zmq.NOBLOCK)
        except self._zmq.Again:
            pass
        except self._zmq.ZMQError as error:
            raise LinkLost(f"{self.host}: {error.strerror}") from None

    def stop(self) -> None:
        """Command zero speed."""
        with suppress(LinkLost):
            self.send(STOP)

    def close(self) -> None:
        """Stop the robot and disconnect, after the host has had time to read the command."""
        self.stop()
        if self._commands is not None:  # the host discards what it has not read when we disconnect
            self._clock.sleep_until(self._clock.now() + _LAST_COMMAND)
        self._disconnect()

    def _disconnect(self) -> None:
        """Close the sockets."""
        for socket in (self._commands, self._observations):
            if socket is not None:
                socket.close()
        self._commands = self._observations = None
        if self._context is not None:
            self._context.term()
            self._context = None


def _check_wheels(robot: Robot) -> None:
    """Raise InvalidInput unless the wheels are those of a LeKiwi, in the order of the host."""
    angles = [mount.axle_angle for mount in robot.mounts]
    if len(angles) != len(BEARINGS) or any(
        abs(remainder(angle - bearing, 2.0 * pi)) > _TURN_TOLERANCE
        or abs(mount.roller_angle) > _TURN_TOLERANCE
        for angle, bearing, mount in zip(angles, BEARINGS, robot.mounts, strict=True)
    ):
        raise InvalidInput(
            f"a LeKiwi has three omni wheels with axles at 60, 180 and -60 degrees, in this order; "
            f"the robot {robot.name} has others: use the robot lekiwi, or a calibrated copy of it"
        )
