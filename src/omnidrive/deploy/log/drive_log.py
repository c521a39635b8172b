"""The log of a drive while it is written."""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from itertools import count
from math import inf
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import NamedTuple

from omnidrive.control import Pipeline
from omnidrive.control.supervision import Event
from omnidrive.deploy.clock import Clock, MonotonicClock, SimulatedClock
from omnidrive.deploy.drive_state import StateChange
from omnidrive.deploy.log.log_file import EVENTS, SAMPLES, LogFile, warm_up
from omnidrive.deploy.log.logged_event import Dropped, File, LoggedEvent, SampleText, encode_event
from omnidrive.deploy.log.logged_sample import LoggedSample, encode_sample
from omnidrive.deploy.log.viewer_messages import BODY, Stamped, ViewerMessages
from omnidrive.deploy.realtime import Measure, schedule_below_loop
from omnidrive.deploy.robot_link import RobotLink
from omnidrive.errors import InvalidInput, one_line
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.parameter import Bounds, check_number
from omnidrive.reference import Reference
from omnidrive.robot.robot_file import robot_text
from omnidrive.ros2.cdr import encode
from omnidrive.ros2.robot_description import robot_description

FORMAT = "omnidrive-drive-log-1"
"""Name of the format in the metadata."""
_log = logging.getLogger("omnidrive")
_FLUSH_PERIOD = 0.25  # s
_CAPACITY = 4096  # samples and events that wait
_VIEWER_RATE = 100.0  # Hz
_PLAN_POSES = 1000
_END_TIME = 20.0  # s
_FULL_WAIT = 0.001  # s
_SIZES = Bounds(1e5, inf, "bytes")
_TIMES = Bounds(1.0, inf, "s")
_END = object()


class LogSummary(NamedTuple):
    """What became of the log of a drive."""

    paths: tuple[Path, ...]
    """Its files, in order."""
    samples: int
    """Number of samples in them."""
    dropped: int
    """Number of samples that are missing, because they could not be written in time or at all."""
    failure: str = ""
    """Why it ends before the drive, in one line; empty: it does not."""


class DriveStart(NamedTuple):
    """What a log holds about a drive before its first sample."""

    link: RobotLink
    """The robot."""
    pipeline: Pipeline
    """Estimator, supervisor and controller, after their reset."""
    reference: Reference
    """The motion to track."""
    dt: float
    """Sample time, s."""
    clock: Clock
    """Clock of the loop."""
    measures: tuple[Measure, ...] = ()
    """What was done for punctuality."""


@dataclass(slots=True)
class DriveLog:
    """Writer of the log of one drive: an MCAP file with messages of ROS.

    The loop appends samples to a queue; a thread encodes and writes them. If the queue is full,
    samples are dropped and counted, unless the clock is simulated: then the loop waits. What is
    written is readable at any time: if the process is killed, at most the last half second is lost.
    If the file cannot be written any more, as on a full disk, the log ends and the drive goes on.

    Attributes:
        path: The file; an existing one is overwritten. With a limit of size or time,
            ``NAME-0000.mcap`` and so on.
        files: Contents of files that describe the drive, by name, such as ``scenario.yaml``; they
            are attached to every file.
        max_bytes: Size from which another file is begun, bytes; None: no limit.
        max_time: Time after which another file is begun, s; None: no limit.
        names: Names of the components ``link``, ``controller`` and ``estimator``, as
            ``omnidrive list`` shows them; otherwise those of their classes.

    Raises:
        InvalidInput: The suffix is not .mcap, or a limit is out of range.
    """

    path: StrPath
    files: Mapping[str, bytes] = field(default_factory=dict)
    max_bytes: float | None = None
    max_time: float | None = None
    names: Mapping[str, str] = field(default_factory=dict)
    _queue: SimpleQueue[object] = field(default_factory=SimpleQueue, init=False)
    _thread: threading.Thread | None = field(default=None, init=False)
    _waits: bool = field(default=False, init=False)
    """Whether the loop waits if the queue is full."""
    _dropped: int = field(default=0, init=False)
    _failure: str = field(default="", init=False)
    _writer: _Writer | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        path = to_path(self.path)
        if path.suffix.lower() != ".mcap":
            raise InvalidInput(f"{one_line(str(path))}: the suffix of the log of a drive is .mcap")
        if self.max_bytes is not None:
            check_number("max_bytes", self.max_bytes, _SIZES)
        if self.max_time is not None:
            check_number("max_time", self.max_time, _TIMES)

    def open(self, start: DriveStart) -> None:
        """Create the file and start the thread.

        Raises:
            MissingExtra: The package mcap is not installed.
            CannotWrite: The file cannot be written.
            InvalidInput: The log of another drive was written with this object.
        """
        if self._writer is not None:
            raise InvalidInput("a DriveLog is for one drive: make another one")
        self._waits = isinstance(start.clock, SimulatedClock)
        self._writer = _Writer(self, start)
        self._thread = threading.Thread(target=self._write, name="omnidrive log", daemon=True)
        self._thread.start()

    def begin(self, t: float) -> None:
        """Tell the time of the first sample on the clock, s; called before :meth:`add`."""
        self._queue.put(t)

    def add(self, item: LoggedSample | LoggedEvent | File) -> None:
        """Append a sample, an event or a file; never blocks on the monotonic clock."""
        if self._queue.qsize() >= _CAPACITY or self._failure:
            while self._waits and not self._failure and self._queue.qsize() >= _CAPACITY:
                time.sleep(_FULL_WAIT)
            if not self._waits or self._failure:
                self._dropped += isinstance(item, LoggedSample)
                return
        self._queue.put(item)

    def close(self) -> LogSummary:
        """Write what waits, and the end of the file."""
        assert self._writer is not None
        assert self._thread is not None
        self._queue.put(_END)
        self._thread.join(_END_TIME)
        if self._thread.is_alive():
            self._failure = f"it is not written within {_END_TIME:g} s"
        while not self._queue.empty():  # the thread has failed
            self._dropped += isinstance(self._queue.get(), LoggedSample)
        writer = self._writer
        return LogSummary(tuple(writer.paths), writer.samples, self._dropped, self._failure)

    def _write(self) -> None:
        """Write what is appended until the end, in the thread."""
        assert self._writer is not None
        if not self._waits:
            schedule_below_loop()
        try:
            self._write_all(self._writer)
        except Exception as error:
            reason = getattr(error, "strerror", None) or one_line(f"{error}")
            self._failure = f"{one_line(str(self._writer.paths[-1]))}: {reason}"
            _log.warning("the log of the drive ends early: %s", self._failure)
            self._writer.abandon()
            self._dropped += self._writer.unwritten

    def _write_all(self, writer: _Writer) -> None:
        due = time.monotonic() + _FLUSH_PERIOD
        reported = 0
        while True:
            try:
                item = self._queue.get(timeout=max(due - time.monotonic(), 0.0))
            except Empty:
                item = None
            if item is _END:
                writer.end(self._dropped)
                return
            if item is not None:
                writer.add(item)
            if self._dropped > reported:
                reported, new = self._dropped, self._dropped - reported
                writer.add(Dropped(new))
            if time.monotonic() >= due:
                writer.flush()
                due = time.monotonic() + _FLUSH_PERIOD


@dataclass(slots=True)
class LogFolder:
    """Folder with the logs of several drives, ``drive-0001.mcap`` and so on.

    Attributes:
        path: The folder, which exists.
        files: Contents of files that are attached to every log, see :class:`DriveLog`.
        max_bytes: Size from which another file is begun, bytes.
        names: Names of the components, see :class:`DriveLog`.
        count: Number of logs so far.
    """

    path: StrPath
    files: Mapping[str, bytes] = field(default_factory=dict)
    max_bytes: float | None = None
    names: Mapping[str, str] = field(default_factory=dict)
    count: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self.path = to_path(self.path)

    def next(self, files: Mapping[str, bytes]) -> DriveLog:
        """Return the log of the next drive, to which further ``files`` are attached."""
        self.count += 1
        path = to_path(self.path) / f"drive-{self.count:04}.mcap"
        return DriveLog(path, {**self.files, **files}, self.max_bytes, names=self.names)


class _Writer:
    """Files of a log, one after the other; used by its thread only.

    Attributes:
        paths: Files so far.
        samples: Number of samples in them.
        unwritten: Number of samples that are in no file yet.
    """

    def __init__(self, log: DriveLog, start: DriveStart) -> None:
        path = to_path(log.path)
        rotated = log.max_bytes is not None or log.max_time is not None
        self._names = (
            (path.with_name(f"{path.stem}-{i:04}{path.suffix}") for i in count())
            if rotated
            else iter([path])
        )
        self._max_bytes, self._max_time = log.max_bytes or inf, log.max_time or inf
        robot = start.link.robot
        self._files = {"robot.yaml": robot_text(robot).encode(), **log.files}
        self._dt = start.dt
        offset = time.time_ns() - time.monotonic_ns()
        self._offset = offset if isinstance(start.clock, MonotonicClock) else 0
        self._description = _description(start, self._offset, log.names)
        self._urdf = robot_description(robot, base=BODY)
        duration = start.reference.duration
        self._plan = start.reference.window(0.0, _PLAN_POSES, duration / (_PLAN_POSES - 1))
        self._viewer = ViewerMessages(robot, start.pipeline.detail_units, self._time_of)
        self._every = max(1, round(1.0 / (start.dt * _VIEWER_RATE)))
        self._begin = 0.0
        self._last = 0
        self.paths: list[Path] = []
        self.samples = self.unwritten = 0
        self._file = self._next_file()
        warm_up()

    def _next_file(self) -> LogFile:
        path = next(self._names)
        number = str(len(self.paths))
        file = LogFile(path, {**self._description, "part": number}, self._files)
        self.paths.append(path)
        self._opened = time.monotonic()
        self._introduced = False
        return file

    def _time_of(self, t: float) -> int:
        """Return the time since 1970, ns, of a time on the clock, s."""
        return round(1e9 * t) + self._offset

    def add(self, item: object) -> None:
        """Write a sample, an event, or the time of the begin."""
        if isinstance(item, float):
            self._begin, self._last = item, self._time_of(item)
            return
        if not self._introduced:
            self._introduced = True
            self._view(self._viewer.plan(self._last, self._plan[:, :3].tolist()))
            self._view(self._viewer.description(self._last, self._urdf))
        if isinstance(item, LoggedSample):
            self._add_sample(item)
            return
        if isinstance(item, File):
            self._file.attach(item.name, item.data)
            return
        assert isinstance(item, LoggedEvent)
        self._file.add(EVENTS, self._last, encode_event(item, *divmod(self._last, 10**9)))
        if isinstance(item, (Event, StateChange)):
            self._view(self._viewer.event(self._last, item))

    def _add_sample(self, sample: LoggedSample) -> None:
        due = sample.number * self._dt
        self._last = self._time_of(self._begin + due)
        step = sample.step
        if step is not None and (step.state.notice or step.command.message):
            message = step.command.message.partition("\n")[0]
            self.add(SampleText(sample.number, step.state.notice, message))
        self.samples += 1
        self.unwritten += 1
        self._file.add(SAMPLES, self._last, encode_sample(sample))
        if sample.number % self._every == 0:
            for each in self._viewer.sample(self._last, due, sample):
                self._view(each)

    def _view(self, stamped: Stamped) -> None:
        self._file.add(stamped.topic, stamped.time, encode(stamped.message))

    def flush(self) -> None:
        """Write the present chunk; begin another file if this one is long enough."""
        self._file.flush()
        self.unwritten = 0
        if self._file.size >= self._max_bytes or time.monotonic() - self._opened >= self._max_time:
            self._file.end({"last": "0"})
            self._file = self._next_file()

    def end(self, dropped: int) -> None:
        """Write the rest and the end of the last file."""
        self._file.end({"last": "1", "samples": str(self.samples), "dropped": str(dropped)})

    def abandon(self) -> None:
        """End the present file after its last chunk."""
        self.samples -= self.unwritten
        self._file.abandon()


def _description(start: DriveStart, offset: int, names: Mapping[str, str]) -> dict[str, str]:
    """Return the metadata of a drive."""
    link, pipeline = start.link, start.pipeline
    watchdog = link.capabilities.watchdog
    return {
        "format": FORMAT,
        "version": version("omnidrive"),
        "drive": str(time.time_ns()),
        "dt": repr(start.dt),
        "clock_offset_ns": str(offset),
        "link": type(link).__name__,
        "watchdog": "" if watchdog is None else repr(watchdog),
        "controller": type(pipeline.controller).__name__,
        "estimator": type(pipeline.estimator).__name__,
        "supervisor": type(pipeline.supervisor).__name__,
        "reference": type(start.reference).__name__,
        "duration": repr(float(start.reference.duration)),
        "measures": "; ".join(map(str, start.measures)),
        "detail_units": json.dumps(dict(pipeline.detail_units)),
        **names,
    }
