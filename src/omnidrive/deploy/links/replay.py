"""Link to a log instead of a robot: its readings arrive as they did, commands are compared."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field

import numpy as np

from omnidrive.control import CommandValue
from omnidrive.deploy.clock import Clock, MonotonicClock, SimulatedClock
from omnidrive.deploy.log.logged_drive import LoggedDrive, read_log
from omnidrive.deploy.log.logged_sample import LoggedSample
from omnidrive.deploy.log_replay import command_rows
from omnidrive.deploy.robot_link import LinkCapabilities, LinkLost
from omnidrive.errors import InvalidLog, one_line
from omnidrive.estimation import SensorReadings
from omnidrive.files.str_path import StrPath
from omnidrive.robot import Robot

_MAX_SAMPLES = 1_000_000


@dataclass(slots=True)
class ReplayLink:
    """The readings of a log, from the sample on with which its controller began to drive.

    Each sample of the loop receives what the same sample of the log received; after the last one
    the link is lost. Commands move nothing.

    Attributes:
        path: The log.
        commands: Time since the first sample, s, of each command, what was commanded, and what the
            log sent at that time.

    Raises:
        InvalidLog: It cannot be read, is damaged, or holds no readings.
    """

    path: StrPath
    commands: list[tuple[float, CommandValue, CommandValue]] = field(
        default_factory=list, init=False
    )
    _log: LoggedDrive = field(init=False)
    _samples: list[LoggedSample] = field(init=False)
    _numbers: list[int] = field(init=False)
    """Number of each sample."""
    _has_fixes: bool = field(init=False)
    """Whether it holds pose fixes."""
    _origin: float = field(init=False)
    """Time of the sample 0 on the clock of the log, s."""
    _clock: Clock = field(default_factory=MonotonicClock, init=False)
    _begin: float | None = field(default=None, init=False)
    """Time of the first sample on the clock of the loop, s; None before the first reading."""
    _is_read: bool = field(default=False, init=False)
    """Whether :meth:`read` was called."""
    _due: int = field(default=-1, init=False)
    """Number of the present sample in the log."""
    _next: int = field(default=0, init=False)
    """Index of the first sample that was not yet read."""

    def __post_init__(self) -> None:
        log = self._log = read_log(self.path)
        first = log.segments[0].number if log.segments else 0
        if log.sample_count > _MAX_SAMPLES:
            raise InvalidLog(f"the log has more than {_MAX_SAMPLES:,} samples")
        self._samples = [each for each in log.samples() if each.number >= first]
        self._numbers = [each.number for each in self._samples]
        ages = [each.read.stamp - each.number * log.dt for each in self._samples if each.read]
        if not ages:
            raise InvalidLog(f"{one_line(str(self.path))} holds no readings")
        self._has_fixes = any(each.read.fixes for each in self._samples if each.read)
        self._origin = max(ages)  # the youngest reading is as old as a sample

    @property
    def robot(self) -> Robot:
        """The robot of the log."""
        return self._log.robot

    @property
    def dt(self) -> float:
        """Sample time of the log, s."""
        return self._log.dt

    @property
    def capabilities(self) -> LinkCapabilities:
        """What the log holds; it takes all commands."""
        return LinkCapabilities(None, self._has_fixes, wheel_speeds=True, wheel_torques=True)

    @property
    def report(self) -> str:
        """How the commands differ from those of the log, in one line."""
        if not self.commands:
            return "no command was compared with the log"
        _, ours, logged = zip(*self.commands, strict=True)
        axes, rows = command_rows([*ours, *logged], self.robot)
        largest = np.abs(rows[: len(ours)] - rows[len(ours) :]).max(axis=0)
        texts = [
            f"{name} {value:.3g} {unit}" for (name, unit), value in zip(axes, largest, strict=True)
        ]
        return f"largest difference of {len(ours)} commands from the log: {', '.join(texts)}"

    def open(self, clock: Clock) -> None:
        """Begin; the first reading defines the time of the first sample."""
        self._clock = clock

    def read(self) -> SensorReadings | None:
        """Return the readings of the log up to the present sample: the newest with all fixes.

        Raises:
            LinkLost: The log ends.
        """
        now, dt = self._clock.now(), self.dt
        if self._begin is None:
            if isinstance(self._clock, SimulatedClock):
                self._begin = now
            elif not self._is_read:  # the loop discards what arrived before
                self._is_read = True
                return None
            else:  # the loop begins one period after the first readings
                self._begin = now + dt
                return self._first_readings(now)
        self._due = self._numbers[0] + round((now - self._begin) / dt)
        if self._due > self._numbers[-1] + 1:
            raise LinkLost("the log ends")
        end = bisect_right(self._numbers, self._due)
        found = [each.read for each in self._samples[self._next : end] if each.read is not None]
        self._next = max(end, self._next)
        if not found:
            return None
        fixes = tuple(fix for readings in found for fix in readings.fixes)
        return self._shifted(found[-1]._replace(fixes=fixes))

    def _first_readings(self, now: float) -> SensorReadings | None:
        """Return the first readings of the log with the stamp ``now`` (s), and without fixes."""
        first = next(each.read for each in self._samples if each.read is not None)
        return first._replace(stamp=now, fixes=())

    def _shifted(self, readings: SensorReadings) -> SensorReadings:
        """Return readings with stamps on the clock of the loop."""
        assert self._begin is not None
        shift = self._begin - (self._origin + self._numbers[0] * self.dt)
        fixes = tuple(fix._replace(stamp=fix.stamp + shift) for fix in readings.fixes)
        return readings._replace(stamp=readings.stamp + shift, fixes=fixes)

    def send(self, value: CommandValue) -> None:
        """Compare a command with that of the log at the same sample, if it has one."""
        at = bisect_left(self._numbers, self._due)
        found = self._numbers[at : at + 1] == [self._due]
        sent = self._samples[at].sent if found else None
        if sent is not None:
            self.commands.append(((self._due - self._numbers[0]) * self.dt, value, sent))

    def stop(self) -> None:
        """Do nothing: there is no robot."""

    def close(self) -> None:
        """Do nothing: the files are closed."""
