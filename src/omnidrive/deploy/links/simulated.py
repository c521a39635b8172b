"""Links to simulated robots: a plant in this process, or in one of its own on wall time."""

from __future__ import annotations

import gc
import os
import signal
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from math import floor
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple

import numpy as np

from omnidrive.control import CommandValue
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import Clock, SimulatedClock
from omnidrive.deploy.links.writable import is_writable
from omnidrive.deploy.realtime import schedule_below_loop
from omnidrive.deploy.robot_link import LinkCapabilities, LinkLost
from omnidrive.errors import InvalidInput
from omnidrive.estimation import SensorReadings
from omnidrive.files.child_processes import safe_path
from omnidrive.geometry import Pose
from omnidrive.parameter import Bounds, check_number
from omnidrive.robot import Robot
from omnidrive.simulation import Plant, PlantState, Sensors

WATCHDOG = 0.5
"""Time without a command after which a simulated robot stops, s."""
_ROUNDING = 1e-9  # s
_OF_TERMINAL = {signal.SIGINT, signal.SIGHUP}
_MAX_SKIPPED = 100  # readings, until the process gives up its priority
_DELAY = Bounds(0.0, 10.0, "s")


class SimulatedRobot(NamedTuple):
    """A plant with its sensors, and the robot that they simulate."""

    robot: Robot
    plant: Plant
    sensors: Sensors


@dataclass(slots=True)
class SimulatedLink:
    """A plant in this process, which moves with a simulated clock: no latency, no waiting.

    With the parts of :func:`~omnidrive.simulate` it gives the commands of that function.

    Attributes:
        simulated: Plant and sensors.
        start: True pose at the start, at rest, in W; m, m, rad.
        states: True states, one for each call of :meth:`read`.
    """

    simulated: SimulatedRobot
    start: Pose
    states: list[PlantState] = field(default_factory=list, init=False)
    _clock: Clock = field(default_factory=SimulatedClock, init=False)
    _time: float | None = field(default=None, init=False)
    """Time up to which the plant was simulated, s; None before the first reading."""
    _step: float = field(default=0.0, init=False)
    """Last time step, s; used again if the next one differs by rounding errors only, so that the
    plant moves exactly as in a simulation."""
    _origin: float = field(default=0.0, init=False)
    _state: PlantState = field(default=PlantState(Pose(0.0, 0.0, 0.0), STOP, 0.0), init=False)
    _command: CommandValue = field(default=STOP, init=False)

    @property
    def robot(self) -> Robot:
        """The simulated robot."""
        return self.simulated.robot

    @property
    def capabilities(self) -> LinkCapabilities:
        """What the plant supports."""
        plant = self.simulated.plant.capabilities
        return LinkCapabilities(WATCHDOG, True, plant.wheel_speeds, plant.wheel_torques)

    def open(self, clock: Clock) -> None:
        """Reset plant and sensors.

        Raises:
            InvalidInput: The clock does not wait for the plant.
        """
        if not isinstance(clock, SimulatedClock):
            raise InvalidInput(
                "a plant in this process needs a SimulatedClock; on wall time use SimulatedProcess"
            )
        self._clock = clock
        self._state = self.simulated.plant.reset(self.start)
        self.simulated.sensors.reset(self.start)

    def read(self) -> SensorReadings | None:
        """Simulate the plant up to the present time and read its sensors."""
        now = self._clock.now()
        if self._time is None:
            self._origin = now
        elif now > self._time:
            step = now - self._time
            if abs(step - self._step) > _ROUNDING:
                self._step = step
            self._state = self.simulated.plant.step(self._command, self._step)
        self._time = now
        self.states.append(self._state)
        readings = self.simulated.sensors.read(now - self._origin, self._state)
        fixes = tuple(fix._replace(stamp=fix.stamp + self._origin) for fix in readings.fixes)
        return readings._replace(stamp=now, fixes=fixes)

    def send(self, value: CommandValue) -> None:
        """Command the plant from now on."""
        self._command = value

    def stop(self) -> None:
        """Command zero speed."""
        self._command = STOP

    def close(self) -> None:
        """Close the plant."""
        self.simulated.plant.close()


@dataclass(slots=True)
class SimulatedProcess:
    """A plant in a process of its own, which moves with the monotonic clock.

    It stops by itself when no command arrives for :data:`WATCHDOG` seconds, as when the driving
    process is killed; when the connection is closed, the process ends. Where the system allows it,
    the process has the policy SCHED_FIFO below the loop, as a real robot does not wait for other
    programs, until a plant that is slower than real time skips 100 readings.

    Attributes:
        robot: The simulated robot.
        make: Picklable function that makes plant and sensors in the new process.
        start: True pose at the start, at rest, in W; m, m, rad.
        period: Time between readings, s.
        latency: Delay of readings and of commands, each, s.
        jitter: Largest random delay in addition, s, uniform.
        seed: Seed of the random delays.
    """

    robot: Robot
    make: Callable[[], SimulatedRobot]
    start: Pose
    period: float
    latency: float = 0.0
    jitter: float = 0.0
    seed: int = 0
    _connection: Connection | None = field(default=None, init=False)
    _process: BaseProcess | None = field(default=None, init=False)
    _capabilities: LinkCapabilities = field(default=LinkCapabilities(WATCHDOG), init=False)

    def __post_init__(self) -> None:
        check_number("period", self.period, Bounds(1e-3, 1.0, "s"))
        check_number("latency", self.latency, _DELAY)
        check_number("jitter", self.jitter, _DELAY)

    @property
    def capabilities(self) -> LinkCapabilities:
        """What the plant supports, from :meth:`open` on."""
        return self._capabilities

    @property
    def pid(self) -> int | None:
        """Number of the process; None before :meth:`open`."""
        return self._process.pid if self._process else None

    def open(self, clock: Clock) -> None:
        """Start the process and wait until the plant is ready.

        Raises:
            LinkLost: The process ends while it starts.
        """
        context = get_context("spawn")
        here, there = context.Pipe()
        settings = _Settings(self.start, self.period, self.latency, self.jitter, self.seed)
        self._process = context.Process(
            target=_simulate, args=(there, self.make, settings), daemon=True
        )
        mask = signal.pthread_sigmask(
            signal.SIG_BLOCK, _OF_TERMINAL
        )  # inherited: the loop stops it
        try:
            with safe_path():
                self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        there.close()
        self._connection = here
        try:
            self._capabilities = here.recv()
        except (EOFError, OSError):
            raise LinkLost("the process of the simulated robot ended while it started") from None

    def read(self) -> SensorReadings | None:
        """Return what arrived since the last call: the newest readings with all fixes."""
        newest: SensorReadings | None = None
        fixes: list[Any] = []
        connection = self._opened()
        try:
            while connection.poll():
                newest = connection.recv()
                fixes += newest.fixes
        except (EOFError, OSError):
            raise LinkLost("the process of the simulated robot has ended") from None
        return newest and newest._replace(fixes=tuple(fixes))

    def send(self, value: CommandValue) -> None:
        """Send a command; it is lost while the process takes none."""
        connection = self._opened()
        try:
            if is_writable(connection):
                connection.send((time.monotonic(), value))
        except (OSError, ValueError):
            raise LinkLost("the process of the simulated robot has ended") from None

    def stop(self) -> None:
        """Command zero speed."""
        if self._connection is not None:
            with suppress(LinkLost):
                self.send(STOP)

    def close(self) -> None:
        """Stop the robot and end the process."""
        self.stop()
        if self._connection is not None:
            self._connection.close()
        if self._process is not None:
            self._process.join(timeout=2.0)
            if self._process.is_alive():
                self._process.kill()
                self._process.join()

    def _opened(self) -> Connection:
        if self._connection is None:
            raise LinkLost("the link is not open")
        return self._connection


class _Settings(NamedTuple):
    start: Pose
    period: float
    latency: float
    jitter: float
    seed: int


def _simulate(
    connection: Connection, make: Callable[[], SimulatedRobot], settings: _Settings
) -> None:
    """Simulate in this process, with readings and commands delayed, until the connection ends."""
    schedule_below_loop()
    _, plant, sensors = make()
    state = plant.reset(settings.start)
    sensors.reset(settings.start)
    plant.step(STOP, settings.period)  # compiles
    state = plant.reset(settings.start)
    supports = plant.capabilities
    gc.collect()
    gc.freeze()  # a full collection of what is loaded takes 0.1 s, in which the robot stands still
    connection.send(LinkCapabilities(WATCHDOG, True, supports.wheel_speeds, supports.wheel_torques))
    with suppress(EOFError, OSError, KeyboardInterrupt):
        _serve(connection, plant, sensors, state, settings)
    plant.close()


class _DueCommand(NamedTuple):
    """A command and the time at which it acts."""

    at: float
    """In s."""
    value: CommandValue


class _DueReadings(NamedTuple):
    """Readings and the time at which they arrive."""

    at: float
    """In s."""
    readings: SensorReadings


class _CommandedPlant:
    """A plant that moves as commanded, each command from the time on at which it is due."""

    def __init__(self, plant: Plant, state: PlantState, begin: float) -> None:
        """Begin at rest, at a time (s)."""
        self.state = state
        self.received: deque[_DueCommand] = deque()
        """Commands in the order of arrival."""
        self._plant = plant
        self._command: CommandValue = STOP
        self._simulated = self._heard = begin

    def move(self, until: float) -> None:
        """Let the commands act that are due up to a time (s), and simulate up to the last."""
        while self.received and self.received[0].at <= until:
            at, value = self.received.popleft()
            self.simulate(at)
            self._command, self._heard = value, at

    def simulate(self, until: float) -> None:
        """Simulate until a time (s); the watchdog stops the robot in between."""
        if self._command != STOP and until - self._heard > WATCHDOG:
            self._advance(self._heard + WATCHDOG)
            self._command = STOP
        self._advance(until)

    def _advance(self, until: float) -> None:
        if until - self._simulated >= 1e-6:
            self.state = self._plant.step(self._command, until - self._simulated)
            self._simulated = until


def _serve(
    connection: Connection, plant: Plant, sensors: Sensors, state: PlantState, settings: _Settings
) -> None:
    """Move the plant with the clock.

    A command acts at the time at which it is sent plus its delay, and readings are those of their
    stamp, also where this process runs late.
    """
    rng = np.random.default_rng(settings.seed)

    def delay() -> float:
        """Return a random delay, s."""
        return settings.latency + settings.jitter * float(rng.random())

    begin = time.monotonic()
    robot = _CommandedPlant(plant, state, begin)
    sent: deque[_DueReadings] = deque()
    number = skipped = 0
    while True:
        due = begin + number * settings.period
        waited = (due, *(each.at for each in robot.received), *(each.at for each in sent))
        wait = min(waited) - time.monotonic()
        waiting = connection.poll(max(wait, 0.0))
        while waiting:
            at, value = connection.recv()
            robot.received.append(_DueCommand(at + delay(), value))
            waiting = connection.poll()
        now = time.monotonic()
        if now >= due:
            robot.move(due)
            robot.simulate(due)
            readings = sensors.read(due - begin, robot.state)
            fixes = tuple(fix._replace(stamp=fix.stamp + begin) for fix in readings.fixes)
            readings = readings._replace(stamp=due, fixes=fixes)
            sent.append(_DueReadings(due + delay(), readings))
            behind = floor((time.monotonic() - due) / settings.period)
            number += 1 + behind
            skipped += behind
            if behind and skipped > _MAX_SKIPPED:  # slower than real time: let others run
                with suppress(OSError, AttributeError):
                    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        robot.move(now)
        while sent and sent[0].at <= now:
            newest = sent.popleft().readings
            if is_writable(connection):  # else the driving process is stopped
                connection.send(newest)
