"""Replay of a log: the commands that a pipeline computes from the logged readings."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.control import CommandValue, Pipeline, PipelineStep, WheelTorques
from omnidrive.control.controller import check_controller
from omnidrive.control.pipeline import PartFailed
from omnidrive.deploy.attached_files import attached_files
from omnidrive.deploy.drive import warm_up
from omnidrive.deploy.drive_progress import DriveProgress
from omnidrive.deploy.log.logged_drive import LoggedDrive
from omnidrive.deploy.log.logged_event import Continued
from omnidrive.deploy.log.logged_sample import LoggedSample
from omnidrive.errors import InvalidInput, InvalidLog, one_line
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Reference, SampledReference, SplicedReference, load_waypoints
from omnidrive.robot import Robot
from omnidrive.simulation.guard import run_timer

_TWIST: tuple[tuple[str, str], ...] = (("vx", "m/s"), ("vy", "m/s"), ("yaw rate", "rad/s"))


@dataclass(frozen=True, eq=False, slots=True)
class LogReplay:
    """Logged commands, and those of a pipeline that received the same readings.

    The robot of the log did not execute the replayed commands: after the first difference, its
    motion is that of the logged ones.

    Attributes:
        t: Time of each sample since the drive began, s.
        axes: Name and unit of each axis: of body twists in B, wheel speeds or wheel torques.
        logged: Logged commands of the controller, before they were limited.
        replayed: Commands of the pipeline.
        equal: Whether they are equal bit for bit.
        logged_status: Status of the logged commands, values of :class:`omnidrive.control.Status`.
        replayed_status: Status of the replayed ones.
        ending: Why the replay ends before the log, in one line; empty: it does not.
    """

    t: Float[Array, " rows"]
    axes: tuple[tuple[str, str], ...]
    logged: Float[Array, "rows axes"]
    replayed: Float[Array, "rows axes"]
    equal: Bool[Array, " rows"]
    logged_status: Int[Array, " rows"]
    replayed_status: Int[Array, " rows"]
    ending: str = ""


class _Row(NamedTuple):
    number: int
    logged: PipelineStep
    replayed: PipelineStep


def replay_log(logged: LoggedDrive, pipeline: Pipeline, reference: Reference) -> LogReplay:
    """Return what a pipeline commands for the readings of a log, as in the drive.

    The pipeline of the drive gives the logged commands bit for bit if it tracks the same reference
    and the log has all samples. Motions along which the drive continued are tables of samples in
    the log: with them the commands are nearly equal.

    Args:
        logged: The log.
        pipeline: Estimator, supervisor and controller.
        reference: The motion to track.

    Raises:
        InvalidInput: The controller has another sample time, or commands torques where the logged
            one commands speeds.
        InvalidLog: The controller did not drive the robot, or a file is damaged.
        OmnidriveError: A part of the pipeline fails before the first sample.
    """
    check_controller(pipeline.controller, logged.dt)
    warm_up(pipeline, reference, logged.dt, len(logged.robot.mounts))
    with run_timer():
        rows, ending = _replayed(logged, pipeline, reference)
    if not rows:
        raise InvalidLog(ending or "the controller did not drive the robot: there is no command")
    first = [row.logged.command.value for row in rows]
    second = [row.replayed.command.value for row in rows]
    axes, commands = command_rows([*first, *second], logged.robot)
    return LogReplay(
        logged.dt * np.array([row.number for row in rows], dtype=float),
        axes,
        commands[: len(rows)],
        commands[len(rows) :],
        np.array([_bits(a) == _bits(b) for a, b in zip(first, second, strict=True)]),
        np.array([int(row.logged.command.status) for row in rows]),
        np.array([int(row.replayed.command.status) for row in rows]),
        ending,
    )


def _replayed(
    logged: LoggedDrive, pipeline: Pipeline, reference: Reference
) -> tuple[list[_Row], str]:
    """Return the samples of both, and why they end before the log."""
    progress, segments = DriveProgress(reference, logged.dt), deque(logged.segments)
    continuations, files = deque(logged.continuations), dict(logged.files)
    rows: list[_Row] = []
    begun = False
    for sample in logged.samples():
        while segments and segments[0].number <= sample.number:
            segment = segments.popleft()
            try:
                pipeline.reset(segment.pose)
            except PartFailed as error:
                return rows, one_line(str(error))
            progress.done = segment.done
            progress.begin(segment.number, pipeline)
            begun = True
        if sample.step is None or not begun:
            continue
        while continuations and continuations[0].number <= sample.number:
            _continue(progress, pipeline, continuations.popleft(), files)
        step = _step(sample, pipeline, progress)
        rows.append(_Row(sample.number, sample.step, step))
        if step.failed and not sample.step.failed:
            reason = step.command.message.partition("\n")[0]
            t = sample.number * logged.dt
            return rows, f"at {t:g} s the {step.failed} failed: {one_line(reason)}"
    return rows, ""


def _continue(
    progress: DriveProgress, pipeline: Pipeline, continued: Continued, files: dict[str, bytes]
) -> None:
    """Track another motion of the log from a sample on; its file is removed from ``files``."""
    name = continued.file
    if name not in files:
        raise InvalidLog(f"the file {one_line(name, 60)} is not attached, or tracked twice")
    with attached_files({name: files.pop(name)}) as folder:
        reference = load_waypoints(folder / name)
    if not isinstance(reference, SampledReference):
        raise InvalidLog(f"{one_line(name, 60)} of the log has no times")
    spliced = SplicedReference.of(progress.governed, reference, continued.at)
    progress.continue_along(spliced, pipeline)


def _step(sample: LoggedSample, pipeline: Pipeline, progress: DriveProgress) -> PipelineStep:
    """Return the step of the pipeline at a sample, as the loop of a drive calls it."""
    if sample.given is None:
        raise InvalidLog(f"sample {sample.number} has a command and no readings")
    if sample.number - progress.first >= progress.last:
        return pipeline.observe(sample.t, sample.given, progress.tracked)
    return pipeline.step(sample.t, sample.given, progress.tracked, progress.dt)


def command_rows(
    values: Sequence[CommandValue], robot: Robot
) -> tuple[tuple[tuple[str, str], ...], Float[Array, "rows axes"]]:
    """Return commands as rows of an array, with name and unit of each axis.

    Wheel speeds beside body twists are converted to twists, by least squares. Zero is zero of any
    kind.

    Raises:
        InvalidInput: Some are torques, and some are not; or one has another number of wheels.
    """
    kinds = {type(value) for value in values if any(value)} or {BodyTwist}
    if WheelTorques in kinds and len(kinds) > 1:
        raise InvalidInput("wheel torques cannot be compared with speeds")
    kind = kinds.pop() if len(kinds) == 1 else BodyTwist
    wheels = len(robot.mounts)
    if any(len(value) != wheels for value in values if not isinstance(value, BodyTwist)):
        raise InvalidInput(f"a command is not for the {wheels} wheels of the robot")
    if kind is BodyTwist:
        axes = _TWIST
    else:
        name, unit = ("torque", "N m") if kind is WheelTorques else ("speed", "rad/s")
        axes = tuple((f"{name} of wheel {i}", unit) for i in range(wheels))
    rows = np.zeros((len(values), len(axes)))
    for row, value in zip(rows, values, strict=True):
        if isinstance(value, kind):
            row[:] = value
        elif any(value):
            row[:] = robot.chassis.twist(value)
    return axes, rows


def _bits(value: CommandValue) -> tuple[type, bytes]:
    """Return a command as bytes, by which 0 and -0 differ and NaN equals NaN."""
    return type(value), np.array(value, dtype=float).tobytes()
