"""Samples of a drive, and their numbers in a log."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from math import nan
from typing import Any, NamedTuple

import numpy as np

from omnidrive.control import (
    Command,
    CommandValue,
    PipelineStep,
    Status,
    WheelSpeeds,
    WheelTorques,
)
from omnidrive.control.pipeline import Part
from omnidrive.deploy.drive_state import DriveState
from omnidrive.errors import InvalidLog, one_line
from omnidrive.estimation import PoseFix, SensorReadings, State
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.ros2.cdr import decode, encode
from omnidrive.ros2.message import message_type

SAMPLE_TYPE = "std_msgs/msg/Float64MultiArray"
"""Message with the numbers of a sample; ``layout.dim`` names its blocks."""
_STATES = tuple(DriveState)
_PARTS: tuple[Part | None, ...] = (None, "reference", "estimator", "supervisor", "controller")
_FIX = 6  # numbers: stamp, x, y, yaw, sigmas of position and yaw


class LoggedSample(NamedTuple):
    """One sample of the loop of a drive."""

    number: int
    """Number of the sample; it is due ``number`` sample times after the drive began."""
    state: DriveState
    """State of the drive at its end."""
    late: float
    """Time to its begin from its deadline, or from the first one that was skipped for it, s."""
    busy: float
    """Time from its begin until the command is sent, s."""
    read: SensorReadings | None = None
    """Readings that arrived, with stamps on the clock of the link; None: nothing arrived."""
    t: float = nan
    """Time since the segment began, s; NaN unless the controller drives."""
    given: SensorReadings | None = None
    """Readings that the pipeline received, with stamps from the begin of the segment; None: it was
    not called."""
    step: PipelineStep | None = None
    """Result of the pipeline; None: it was not called."""
    sent: CommandValue | None = None
    """Command that was sent; None: none."""


class Segment(NamedTuple):
    """Begin of a segment: the pipeline is reset, and tracks what remains of the reference."""

    number: int
    """Number of its first sample."""
    pose: Pose
    """Pose with which the pipeline is reset, in W; m, m, rad."""
    done: float = 0.0
    """Time of the reference that former segments tracked, s; 0: the whole reference remains."""
    begin: float = 0.0
    """Time of the begin in the table of the drive, s, which has no rows for pauses."""


def encode_sample(sample: LoggedSample) -> bytes:
    """Return the numbers of a sample as a message :data:`SAMPLE_TYPE`, every digit of them.

    Notices and reasons are no numbers; they are events of the log.
    """
    names: list[tuple[str, int]] = []
    numbers: list[float] = []

    def add(name: str, values: Sequence[float]) -> None:
        """Append one block."""
        names.append((name, len(values)))
        numbers.extend(values)

    add("loop", (sample.number, _STATES.index(sample.state), sample.late, sample.busy))
    for prefix, readings in (("read_", sample.read), ("given_", sample.given)):
        if readings is not None:
            _add_readings(add, prefix, readings)
    if sample.step is not None:
        add("t", (sample.t,))
        _add_step(add, sample.step)
    if sample.sent is not None:
        _add_command(add, "sent_", sample.sent)
    head, gap = _head(tuple(names))
    return head + struct.pack(f"<I{gap}x{len(numbers)}d", len(numbers), *numbers)


def _add_readings(add: Any, prefix: str, readings: SensorReadings) -> None:
    add(prefix + "stamp", (readings.stamp,))
    if readings.wheel_angles:
        add(prefix + "wheel_angles", readings.wheel_angles)
    if readings.wheel_torques:
        add(prefix + "wheel_torques", readings.wheel_torques)
    if readings.yaw_rate is not None:
        add(prefix + "yaw_rate", (readings.yaw_rate,))
    if readings.fixes:
        fixes = [(f.stamp, *f.pose, f.position_sigma, f.yaw_sigma) for f in readings.fixes]
        add(prefix + "fixes", [number for fix in fixes for number in fix])


def _add_step(add: Any, step: PipelineStep) -> None:
    state, command = step.state, step.command
    add("state", (state.stamp, *state.pose, state.fix_age))
    if state.twist is not None:
        add("state_twist", state.twist)
    if state.covariance is not None:
        add("state_covariance", state.covariance.ravel().tolist())
    add("target", step.target)
    _add_command(add, "command_", command.value)
    add("status", (command.status, step.step_time, _PARTS.index(step.failed)))
    if command.details:
        add("details", command.details)


def _add_command(add: Any, prefix: str, value: CommandValue) -> None:
    kind = "twist" if isinstance(value, BodyTwist) else value.noun.replace(" ", "_")
    add(prefix + kind, value)


@lru_cache(maxsize=256)
def _head(names: tuple[tuple[str, int], ...]) -> tuple[bytes, int]:
    """Return a message up to the count of its numbers, and the number of bytes that align them."""
    made = message_type(SAMPLE_TYPE)()
    dimension = message_type("std_msgs/msg/MultiArrayDimension")
    made.layout.dim = [dimension(label=name, size=size, stride=size) for name, size in names]
    head = encode(made)[:-4]
    return head, -len(head) % 8  # the header, from behind which is counted, has four bytes


def decode_sample(data: bytes) -> LoggedSample:
    """Return the sample of a message of :func:`encode_sample`.

    Raises:
        InvalidLog: The message holds something else.
    """
    try:
        message: Any = decode(data, SAMPLE_TYPE)
        return _sample(_blocks(message))
    except (ValueError, KeyError, IndexError, TypeError, OverflowError) as error:
        what = "a block is missing" if isinstance(error, KeyError) else str(error)
        raise InvalidLog(f"a sample is malformed: {one_line(what, 100)}") from None


def _blocks(message: Any) -> dict[str, tuple[float, ...]]:
    """Return the numbers of a message by the names of their blocks."""
    numbers = message.data.tolist()
    blocks: dict[str, tuple[float, ...]] = {}
    at = 0
    for each in message.layout.dim:
        blocks[each.label] = tuple(numbers[at : at + each.size])
        at += each.size
    if at != len(numbers):
        raise ValueError(f"{len(numbers)} numbers, the layout has {at}")
    return blocks


def _sample(blocks: dict[str, tuple[float, ...]]) -> LoggedSample:
    number, state, late, busy = blocks["loop"]
    return LoggedSample(
        _index(number, 2**53),
        _STATES[_index(state, len(_STATES))],
        late,
        busy,
        _readings(blocks, "read_"),
        blocks["t"][0] if "t" in blocks else nan,
        _readings(blocks, "given_"),
        _step(blocks) if "t" in blocks else None,
        _command(blocks, "sent_"),
    )


def _readings(blocks: dict[str, tuple[float, ...]], prefix: str) -> SensorReadings | None:
    if prefix + "stamp" not in blocks:
        return None
    (stamp,) = blocks[prefix + "stamp"]
    rate = blocks.get(prefix + "yaw_rate")
    flat = blocks.get(prefix + "fixes", ())
    if len(flat) % _FIX:
        raise ValueError(f"{len(flat)} numbers of pose fixes")
    fixes = []
    for i in range(0, len(flat), _FIX):
        at, x, y, yaw, position_sigma, yaw_sigma = flat[i : i + _FIX]
        fixes.append(PoseFix(at, Pose(x, y, yaw), position_sigma, yaw_sigma))
    return SensorReadings(
        stamp,
        blocks.get(prefix + "wheel_angles", ()),
        blocks.get(prefix + "wheel_torques", ()),
        None if rate is None else rate[0],
        tuple(fixes),
    )


def _step(blocks: dict[str, tuple[float, ...]]) -> PipelineStep:
    stamp, x, y, yaw, age = blocks["state"]
    twist, covariance = blocks.get("state_twist"), blocks.get("state_covariance")
    status, step_time, failed = blocks["status"]
    value = _command(blocks, "command_")
    if value is None:
        raise KeyError("command")
    return PipelineStep(
        State(
            stamp,
            Pose(x, y, yaw),
            None if twist is None else BodyTwist(*twist),
            None if covariance is None else np.reshape(covariance, (3, 3)),
            age,
        ),
        Pose(*blocks["target"]),
        Command(value, Status(int(status)), blocks.get("details", ())),
        step_time,
        _PARTS[_index(failed, len(_PARTS))],
    )


def _index(number: float, count: int) -> int:
    if not (0.0 <= number < count and number.is_integer()):
        raise ValueError(f"{number:g} is no index below {count}")
    return int(number)


def _command(blocks: dict[str, tuple[float, ...]], prefix: str) -> CommandValue | None:
    if prefix + "twist" in blocks:
        return BodyTwist(*blocks[prefix + "twist"])
    if prefix + "wheel_speeds" in blocks:
        return WheelSpeeds(blocks[prefix + "wheel_speeds"])
    if prefix + "wheel_torques" in blocks:
        return WheelTorques(blocks[prefix + "wheel_torques"])
    return None
