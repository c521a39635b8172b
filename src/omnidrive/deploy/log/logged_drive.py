"""The log of a drive, read from its files."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

from omnidrive.control import Pipeline
from omnidrive.control.feedforward import FeedforwardController
from omnidrive.control.supervision import Event
from omnidrive.deploy.drive_state import REFERENCE_ENDS, StateChange
from omnidrive.deploy.log.drive_log import FORMAT
from omnidrive.deploy.log.log_file import DESCRIPTION, END, EVENTS, SAMPLES
from omnidrive.deploy.log.logged_event import (
    Continued,
    Dropped,
    LoggedEvent,
    SampleText,
    decode_event,
)
from omnidrive.deploy.log.logged_sample import LoggedSample, Segment, decode_sample
from omnidrive.deploy.log.record_reader import LoggedMessage, read_records
from omnidrive.deploy.loop_timing import LoopTiming
from omnidrive.errors import InvalidLog, one_line
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import parse_yaml
from omnidrive.geometry import BodyTwist
from omnidrive.robot import Robot
from omnidrive.robot.robot_file import parse_robot
from omnidrive.simulation import Outcome, PlantState, Run
from omnidrive.simulation.guard import RunEnded
from omnidrive.simulation.run_log import RunLog

_MAX_BYTES = 1 << 27  # of attached files and of events
_MAX_FILES, _MAX_EVENTS = 10_000, 1_000_000  # a drive adds a file for each path it continues on
RUN_LOG = "log.mcap"
"""Name of the log in the run folder of a drive."""
MAX_SAMPLES = 2_000_000
"""Largest number of samples that are kept in memory at once: 33 minutes at 1 kHz."""
_TIMED_SAMPLES = 10_000_000
_CUT = "the log ends before the drive"
_LARGEST = 1e10  # m and rad
_MAX_NAMED = 5  # logs in a message
_DIGITS = 4  # of the number of a file in a rotated log


@dataclass(frozen=True, eq=False)
class LoggedDrive:
    """The log of a drive; its samples are read from the files each time they are asked for.

    Attributes:
        paths: Files of the log, in order.
        metadata: Description of the drive: ``controller``, ``estimator``, ``link`` and others.
        files: Contents of the attached files by name, such as ``robot.yaml``.
        changes: History of the state.
        segments: Begins of the segments in which the controller drove.
        continuations: Other motions that were tracked without a stop.
        events: Events of supervisor and estimator; times since the drive began, s.
        complete: Whether the log has its end; false if the process was killed or the disk full.
        dropped: Number of samples that are missing.
        sample_count: Number of samples.
    """

    paths: tuple[Path, ...]
    metadata: Mapping[str, str]
    files: Mapping[str, bytes]
    changes: tuple[StateChange, ...]
    segments: tuple[Segment, ...]
    continuations: tuple[Continued, ...]
    events: tuple[Event, ...]
    complete: bool
    dropped: int
    sample_count: int

    @cached_property
    def dt(self) -> float:
        """Sample time, s.

        Raises:
            InvalidLog: It is missing or unusable.
        """
        value = _number(self.metadata.get("dt", ""))
        if not 0.0 < value <= 1.0:
            raise InvalidLog(f"{self._name} has no usable sample time")
        return value

    @cached_property
    def robot(self) -> Robot:
        """The robot that the link described.

        Raises:
            InvalidRobot: The attached file is malformed.
            InvalidLog: It is missing.
        """
        if "robot.yaml" not in self.files:
            raise InvalidLog(f"{self._name} has no robot.yaml")
        where = f"robot.yaml of {self._name}"
        return parse_robot(parse_yaml(self.files["robot.yaml"], where, "robot", InvalidLog), where)

    @cached_property
    def detail_units(self) -> dict[str, str]:
        """Names and units of the controller's details.

        Raises:
            InvalidLog: They are malformed.
        """
        try:
            units = json.loads(self.metadata.get("detail_units", "{}"))
        except (ValueError, RecursionError):
            units = None
        if not isinstance(units, dict) or not all(isinstance(u, str) for u in units.values()):
            raise InvalidLog(f"{self._name}: the units of the details are malformed")
        return units

    @property
    def has_steps(self) -> bool:
        """Whether it has a sample in which the controller drove, which :meth:`run` needs."""
        return any(sample.step is not None for sample in self.samples())

    @property
    def _name(self) -> str:
        return one_line(str(self.paths[0]))

    def samples(self) -> Iterator[LoggedSample]:
        """Yield all samples in order.

        Raises:
            InvalidLog: A file is damaged, or was replaced, or samples are not in order.
        """
        text: SampleText | None = None
        last = -1
        for item in _items(self.paths):
            if isinstance(item, SampleText):
                text = item
            elif isinstance(item, LoggedSample):
                if item.number <= last:
                    raise InvalidLog(
                        f"{self._name}: sample {item.number} is not after sample {last}"
                    )
                last = item.number
                yield item if text is None else _with_text(item, text)

    def check_length(self) -> None:
        """Raise InvalidLog if there are more than :data:`MAX_SAMPLES`."""
        if self.sample_count > MAX_SAMPLES:
            raise InvalidLog(
                f"{self._name} has {self.sample_count:,} samples, at most {MAX_SAMPLES:,}: split "
                "the drive, or lower its rate (--rate)"
            )

    def timing(self) -> LoopTiming:
        """Return the punctuality of the loop."""
        timing = LoopTiming(max(1, min(self.sample_count, _TIMED_SAMPLES)))
        for sample in self.samples():
            timing.add(sample.late, sample.busy)
            behind = (sample.late + sample.busy) / self.dt
            if 1.0 <= behind < inf:
                timing.misses += 1
                timing.skipped += int(behind)
        return timing

    def run(self) -> Run:
        """Return the samples in which the controller drove, as in ``od.drive(...).run``.

        Its true pose is the estimated one; work is NaN.

        Raises:
            InvalidLog: There are no such samples, or a file is damaged.
        """
        pipeline = Pipeline(FeedforwardController(self.dt))
        pipeline.detail_units = self.detail_units
        log = RunLog(pipeline)
        self.check_length()
        segments = deque(self.segments)
        begin, failed, last = 0.0, False, -inf
        wheels = len(self.robot.mounts)
        for sample in self.samples():
            while segments and segments[0].number <= sample.number:
                begin = segments.popleft().begin
            step = sample.step
            if step is None:
                continue
            failed = step.failed is not None
            details = step.command.details
            if details and len(details) != len(self.detail_units):
                raise InvalidLog(f"{self._name}: sample {sample.number} has {len(details)} details")
            value, t = step.command.value, begin + sample.t
            if not isinstance(value, BodyTwist) and len(value) != wheels:
                raise InvalidLog(
                    f"{self._name}: the command of sample {sample.number} is not for the {wheels} "
                    "wheels of the robot"
                )
            if not last < t < inf:
                raise InvalidLog(
                    f"{self._name}: the time of sample {sample.number} is not after that of the "
                    "sample before"
                )
            if any(abs(each) > _LARGEST for each in (*step.state.pose, *step.target)):
                raise InvalidLog(
                    f"{self._name}: a pose of sample {sample.number} exceeds {_LARGEST:g} m or rad"
                )
            last = t
            twist = step.state.twist or BodyTwist(nan, nan, nan)
            log.add(t, PlantState(step.state.pose, twist, nan), step)
        if not log.rows:
            raise InvalidLog(f"{self._name}: the controller did not drive the robot")
        ending = self.changes[-1].reason if self.complete and self.changes else _CUT
        if ending != REFERENCE_ENDS or failed:
            log.end = RunEnded(Outcome.STOPPED, ending)
        changes = [Event(c.t, f"{c.state.value}: {c.reason}") for c in self.changes]
        return log.run([*changes, *self.events])


def read_log(path: StrPath) -> LoggedDrive:
    """Return the log of a drive.

    A log that ends early, because the process was killed or the disk was full, is read up to its
    last complete chunk. If the file is the first of several, the others of the drive are read, too.

    Args:
        path: File with the suffix .mcap that ``omnidrive drive`` or :class:`DriveLog` wrote, or a
            folder with the file ``log.mcap`` or the log of one drive only.

    Raises:
        InvalidLog: It cannot be read, is damaged, or is not the log of a drive.
        MissingExtra: The package mcap is not installed.
    """
    first = _log_file(to_path(path))
    parts = [_read_part(first)]
    paths = [first]
    while parts[-1].end is not None and parts[-1].end.get("last") == "0":
        after = _after(paths[-1])
        if after is None or not after.is_file():
            break
        part = _read_part(after)
        if part.metadata["drive"] != parts[0].metadata["drive"]:
            break
        parts.append(part)
        paths.append(after)
    items = [item for part in parts for item in part.items]
    end = parts[-1].end or {}
    return LoggedDrive(
        tuple(paths),
        parts[0].metadata,
        {name: data for part in reversed(parts) for name, data in part.files.items()},
        tuple(item for item in items if isinstance(item, StateChange)),
        tuple(item for item in items if isinstance(item, Segment)),
        tuple(item for item in items if isinstance(item, Continued)),
        tuple(item for item in items if isinstance(item, Event)),
        end.get("last") == "1",
        sum(item.samples for item in items if isinstance(item, Dropped)),
        sum(part.samples for part in parts),
    )


def _log_file(path: Path) -> Path:
    """Return the log in a run folder; a file as it is."""
    if not path.is_dir():
        return path
    found = path / RUN_LOG
    if found.is_file():
        return found
    files = (each for each in path.glob("*.mcap") if not _is_later_part(each))
    logs = sorted(islice(files, _MAX_NAMED))
    if len(logs) == 1:
        return logs[0]
    names = f"; name one of its logs: {', '.join(each.name for each in logs)}" if logs else ""
    raise InvalidLog(one_line(f"the folder {path} has no {RUN_LOG}{names}"))


def _is_later_part(path: Path) -> bool:
    """Return whether a file belongs to a rotated log whose first file is beside it."""
    if _after(path) is None or not int(path.stem[-_DIGITS:]):
        return False
    return path.with_name(f"{path.stem[:-_DIGITS]}{0:0{_DIGITS}}{path.suffix}").is_file()


class _Part(NamedTuple):
    """One file of a log, without its samples."""

    metadata: dict[str, str]
    files: dict[str, bytes]
    items: list[LoggedEvent]
    samples: int
    end: dict[str, str] | None


def _read_part(path: Path) -> _Part:
    metadata: dict[str, str] | None = None
    end: dict[str, str] | None = None
    files: dict[str, bytes] = {}
    events: list[LoggedEvent] = []
    samples = held = 0  # samples, and bytes of files and events
    topics: dict[int, str] = {}
    for record in read_records(path):
        kind = type(record).__name__
        if isinstance(record, LoggedMessage):
            topic = topics.get(record.channel)
            samples += topic == SAMPLES
            if topic == EVENTS and (event := decode_event(record.data)) is not None:
                events.append(event)
                held += len(record.data)
        elif kind == "Channel":
            topics[record.id] = _checked_topic(record)
        elif kind == "Metadata" and record.name == DESCRIPTION:
            metadata = record.metadata
        elif kind == "Metadata" and record.name == END:
            end = record.metadata
        elif kind == "Attachment":
            files[record.name] = record.data
            held += len(record.name) + len(record.data)
        if held > _MAX_BYTES or len(files) > _MAX_FILES or len(events) > _MAX_EVENTS:
            raise InvalidLog(
                f"{one_line(str(path))} has more than {_MAX_FILES:,} files, {_MAX_EVENTS:,} "
                f"events or {_MAX_BYTES >> 20} MiB of them"
            )
    if metadata is None or metadata.get("format") != FORMAT:
        raise InvalidLog(
            f"{one_line(str(path))} is not the log of a drive: it has no metadata {DESCRIPTION} of "
            f"the format {FORMAT}"
        )
    metadata.setdefault("drive", "")
    return _Part(metadata, files, events, samples, end)


def _items(paths: tuple[Path, ...]) -> Iterator[LoggedSample | LoggedEvent]:
    """Yield samples and events of all files in order."""
    for path in paths:
        topics: dict[int, str] = {}
        for record in read_records(path):
            if type(record).__name__ == "Channel":
                topics[record.id] = _checked_topic(record)
            elif isinstance(record, LoggedMessage):
                topic = topics.get(record.channel)
                if topic == SAMPLES:
                    yield decode_sample(record.data)
                elif topic == EVENTS and (event := decode_event(record.data)) is not None:
                    yield event


def _with_text(sample: LoggedSample, text: SampleText) -> LoggedSample:
    """Return a sample with its texts, if they are of this sample."""
    step = sample.step
    if step is None or text.number != sample.number:
        return sample
    state = step.state._replace(notice=text.notice)
    command = step.command._replace(message=text.message)
    return sample._replace(step=step._replace(state=state, command=command))


def _checked_topic(channel: Any) -> str:
    """Return the topic of a channel; raise InvalidLog if it is ours with another encoding."""
    topic: str = channel.topic
    if topic in {SAMPLES, EVENTS} and channel.message_encoding != "cdr":
        encoding = one_line(channel.message_encoding, 20)
        raise InvalidLog(f"messages on {topic} have the encoding {encoding}, need cdr")
    return topic


def _after(path: Path) -> Path | None:
    """Return the name of the file after one of a rotated log; None: it has no number."""
    number = path.stem[-_DIGITS:]
    if not (number.isdecimal() and number.isascii()):
        return None
    return path.with_name(f"{path.stem[:-_DIGITS]}{int(number) + 1:0{_DIGITS}}{path.suffix}")


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return nan
    return value if isfinite(value) else nan
