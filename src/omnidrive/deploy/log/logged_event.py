"""What happens between the samples of a drive, and its texts in a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from omnidrive.control.supervision import Event
from omnidrive.deploy.drive_state import DriveState, StateChange
from omnidrive.deploy.log.logged_sample import Segment
from omnidrive.errors import InvalidLog, one_line
from omnidrive.geometry import Pose
from omnidrive.ros2.cdr import decode, encode
from omnidrive.ros2.message import message_type

EVENT_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
"""Message with what happened, in the values of its only status."""
_MAX_TEXT = 2000  # characters
_LONGEST = 1e9  # s


class SampleText(NamedTuple):
    """Texts of a sample, which its numbers cannot hold; they come before it."""

    number: int
    """Number of the sample."""
    notice: str
    """Notice of the estimator; may be empty."""
    message: str
    """Reason for which a part failed; may be empty."""


class Dropped(NamedTuple):
    """Samples that are missing, because the log was not written as fast as the drive went on."""

    samples: int
    """Their number."""


class Continued(NamedTuple):
    """Another motion is tracked in the present segment, without a stop."""

    number: int
    """Number of the first sample in which it is tracked."""
    at: float
    """Time since the segment began at which it begins, s."""
    file: str
    """Name of the attached file with its samples."""


class File(NamedTuple):
    """A file that is attached to the log during the drive."""

    name: str
    data: bytes


LoggedEvent = StateChange | Segment | Event | SampleText | Dropped | Continued
"""What a log contains besides samples."""
_NAMES: dict[type, str] = {
    StateChange: "state",
    Segment: "segment",
    Event: "event",
    SampleText: "text",
    Dropped: "dropped",
    Continued: "continued",
}


def encode_event(item: LoggedEvent, sec: int, nanosec: int) -> bytes:
    """Return what happened as a message :data:`EVENT_TYPE`.

    Args:
        item: What happened.
        sec: Time of the message since 1970, whole seconds.
        nanosec: The rest of it, ns.
    """
    pair = message_type("diagnostic_msgs/msg/KeyValue")
    message = message_type(EVENT_TYPE)()
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    values = [pair(key=key, value=_text(value)) for key, value in item._asdict().items()]
    message.status = [
        message_type("diagnostic_msgs/msg/DiagnosticStatus")(
            name=f"omnidrive: {_NAMES[type(item)]}", values=values
        )
    ]
    return encode(message)


def _text(value: Any) -> str:
    """Return a value as text, with every digit."""
    if isinstance(value, DriveState):
        return value.value
    if isinstance(value, str):
        return one_line(value, _MAX_TEXT)
    if isinstance(value, Pose):
        return " ".join(repr(float(number)) for number in value)
    return str(value) if isinstance(value, int) else repr(float(value))


def decode_event(data: bytes) -> LoggedEvent | None:
    """Return what a message of :func:`encode_event` holds; None: something unknown.

    Raises:
        InvalidLog: The message is malformed.
    """
    try:
        message: Any = decode(data, EVENT_TYPE)
        (status,) = message.status
        values = {each.key: each.value for each in status.values}
        return _event(status.name.removeprefix("omnidrive: "), values)
    except (ValueError, KeyError, TypeError) as error:
        what = "a value is missing" if isinstance(error, KeyError) else str(error)
        raise InvalidLog(f"an event is malformed: {one_line(what, 100)}") from None


def _event(name: str, values: Mapping[str, str]) -> LoggedEvent | None:
    if name == "state":
        return StateChange(float(values["t"]), DriveState(values["state"]), values["reason"])
    if name == "segment":
        pose = Pose(*map(float, values["pose"].split()))
        return Segment(
            int(values["number"]), pose, _duration(values["done"]), float(values["begin"])
        )
    if name == "event":
        return Event(float(values["t"]), values["what"])
    if name == "text":
        return SampleText(int(values["number"]), values["notice"], values["message"])
    if name == "continued":
        return Continued(int(values["number"]), _duration(values["at"]), values["file"])
    return Dropped(int(values["samples"])) if name == "dropped" else None


def _duration(text: str) -> float:
    """Return a time since a begin, s; raise ValueError unless it is one."""
    found = float(text)
    if not 0.0 <= found <= _LONGEST:
        raise ValueError(f"a time of {one_line(text, 40)} s, need 0 to {_LONGEST:g} s")
    return found
