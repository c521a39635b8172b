"""Log of a closed loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.control.supervision import Event
from omnidrive.errors import RunFailed
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.geometry import wrap
from omnidrive.notebook import BLUE, Drawing, box_around, facts_html
from omnidrive.simulation.log_columns import POSE, TWIST, LogColumn, vector_columns

if TYPE_CHECKING:
    from pandas import DataFrame

_MAX_EVENTS = 5  # in notebooks


class Outcome(Enum):
    """Why a run ended."""

    FINISHED = "reached the end of the reference"
    CONTROLLER_FAILED = "the controller had no usable command"
    ESTIMATOR_FAILED = "the state estimator failed"
    SUPERVISOR_FAILED = "the supervisor failed"
    SENSORS_FAILED = "the sensors failed"
    REFERENCE_FAILED = "the reference failed"
    PLANT_FAILED = "the plant failed"
    PLANT_LOST = "the plant was lost"
    STOPPED = "the watchdog stopped the robot"
    KILLED = "the process of the run was killed"
    TIMED_OUT = "the run exceeded its time limit"


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """Log of one closed loop: one row per sample, the last at the end of the reference.

    Attributes:
        t: Time of each row, in s.
        pose: True pose of B in W; x and y in m, yaw in rad, unwrapped.
        measured: Estimated pose, as ``pose``.
        position_sigma: Standard deviation of the estimated position along the least certain
            direction, m; NaN if unknown.
        yaw_sigma: Standard deviation of the estimated yaw, rad; NaN if unknown.
        target: Reference pose, as ``pose``.
        command: Body twist commanded at ``t``, before wheel saturation; m/s, m/s, rad/s. NaN for
            a command of wheel speeds or torques.
        twist: True body twist, as ``command``.
        wheel_speed: True speed of each wheel, rad/s, with the signs of the wheel matrix. No columns
            if the plant does not report it.
        wheel_torque: Mean torque of each motor at its wheel in the sample that ends at ``t``, N m.
            No columns if the plant does not report it.
        saturated: Limits that were reached in the sample that ends at ``t``: a sum of
            :class:`~omnidrive.simulation.Saturation`.
        wheel_speed_command: Wheel speeds commanded at ``t``, rad/s; NaN for another command. No
            columns if the controller commands none.
        wheel_torque_command: Wheel torques commanded at ``t``, N m, likewise.
        work: Mechanical work of the motors since the start, in J; NaN without forces.
        step_time: Computing time of ``Controller.step`` in its thread, in us; NaN in the last row.
        status: :class:`~omnidrive.control.Status` of each command.
        collisions: Number of contacts with obstacles that have begun since the start.
        outcome: Why the run ended.
        details: Details of a :class:`~omnidrive.control.DetailedController` at each sample, by
            name; NaN for a command without details, as in the last row.
        detail_units: Unit of each detail.
        events: Start and end of faults, findings and reactions of the supervisor, in order.
        reason: Reason of the outcome in one line; may be empty.
        traceback: Traceback of the exception that ended the run; empty without one.
    """

    t: Float[Array, " rows"]
    pose: Float[Array, "rows 3"]
    measured: Float[Array, "rows 3"]
    position_sigma: Float[Array, " rows"]
    yaw_sigma: Float[Array, " rows"]
    target: Float[Array, "rows 3"]
    command: Float[Array, "rows 3"]
    twist: Float[Array, "rows 3"]
    wheel_speed: Float[Array, "rows _"]
    wheel_torque: Float[Array, "rows _"]
    saturated: Int[Array, " rows"]
    wheel_speed_command: Float[Array, "rows _"]
    wheel_torque_command: Float[Array, "rows _"]
    work: Float[Array, " rows"]
    step_time: Float[Array, " rows"]
    status: Int[Array, " rows"]
    collisions: Int[Array, " rows"]
    outcome: Outcome
    details: dict[str, Float[Array, " rows"]] = field(default_factory=dict)
    detail_units: dict[str, str] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    reason: str = ""
    traceback: str = ""

    @property
    def ending(self) -> str:
        """Outcome and reason as text."""
        return self.outcome.value + (f": {self.reason}" if self.reason else "")

    def raise_if_failed(self) -> Run:
        """Return self, or raise :class:`RunFailed` if the run ended before its reference."""
        if self.outcome is not Outcome.FINISHED:
            raise RunFailed(f"stopped at {self.t[-1]:g} s: {self.ending}")
        return self

    @property
    def columns(self) -> tuple[LogColumn, ...]:
        """All quantities of the log; only ``step_time`` is not reproducible.

        Standard deviations are there if a sample has them.
        """
        sigmas = (
            LogColumn("position_sigma", "m", self.position_sigma),
            LogColumn("yaw_sigma", "rad", self.yaw_sigma),
        )
        return (
            LogColumn("t", "s", self.t),
            *vector_columns("", POSE, self.pose),
            *vector_columns("measured_", POSE, self.measured),
            *(each for each in sigmas if not np.isnan(each.values).all()),
            *vector_columns("target_", POSE, self.target),
            *vector_columns("command_", TWIST, self.command),
            *vector_columns("actual_", TWIST, self.twist),
            LogColumn("work", "J", self.work),
            LogColumn("status", "1", self.status),
            LogColumn("collisions", "1", self.collisions),
            LogColumn("step_time", "us", self.step_time),
            LogColumn("saturated", "1", self.saturated),
            *_wheel_columns("wheel_speed", "rad/s", self.wheel_speed),
            *_wheel_columns("wheel_torque", "N m", self.wheel_torque),
            *_wheel_columns("command_wheel_speed", "rad/s", self.wheel_speed_command),
            *_wheel_columns("command_wheel_torque", "N m", self.wheel_torque_command),
            *(LogColumn(k, self.detail_units[k], values) for k, values in self.details.items()),
        )

    def to_pandas(self) -> DataFrame:
        """Return the log as a table with one row per sample; its ``attrs["units"]`` hold the units.

        Raises:
            MissingExtra: pandas is not installed.
        """
        from omnidrive.simulation.log_file import log_frame  # noqa: PLC0415 - takes a second

        return log_frame(self.columns)

    def save(self, path: StrPath) -> None:
        """Write the log to a file; :func:`~omnidrive.load_run` reads Parquet files.

        Args:
            path: File name; an existing file is overwritten. The suffix selects the format:
                .parquet, .csv, or .mcap for Foxglove and other tools of robotics.

        Raises:
            InvalidInput: The suffix is another one.
            MissingExtra: The suffix is .mcap, and the package mcap is not installed.
            CannotWrite: The file cannot be written.
        """
        from omnidrive.simulation.log_file import save_log  # noqa: PLC0415 - takes a second

        path, events = to_path(path), self.events
        if path.suffix.lower() == ".mcap":  # the outcome is a message
            events = (*events, Event(float(self.t[-1]), f"end: {self.ending}"))
        ending = {
            "outcome": self.outcome.name,
            "reason": self.reason,
            "traceback": self.traceback,
            "events": events,
        }
        save_log(self.columns, ending, path)

    def _repr_html_(self) -> str:
        """Return drawing and main results for notebooks."""
        distance = np.hypot(*(self.pose - self.target)[:, :2].T)
        turn = np.abs(wrap(self.pose[:, 2] - self.target[:, 2]))
        facts = {
            "outcome": self.ending,
            "duration": f"{self.t[-1]:g} s, {len(self.t)} samples",
            "position error": f"mean {distance.mean():.4g} m, largest {distance.max():.4g} m",
            "heading error": f"mean {turn.mean():.4g} rad, largest {turn.max():.4g} rad",
            "work": f"{self.work[-1]:.4g} J",
            "collisions": f"{self.collisions[-1]}",
            "events": "; ".join(f"{t:g} s {what}" for t, what in self.events[:_MAX_EVENTS]),
        }
        positions = np.vstack([self.pose, self.target])[:, :2]
        drawing = Drawing(box_around(positions), width=180.0)
        drawing.line(self.target[:, :2], dashed=True)
        drawing.line(self.pose[:, :2], BLUE)
        shown = {k: text for k, text in facts.items() if text and text not in {"nan J", "0"}}
        return facts_html("Run", shown, drawing.svg())


def _wheel_columns(name: str, unit: str, block: Float[Array, "rows _"]) -> tuple[LogColumn, ...]:
    """Return one column per wheel, with the wheel's number from 0 at the end of its name."""
    return tuple(LogColumn(f"{name}_{i}", unit, values) for i, values in enumerate(block.T))
