"""Log of a closed loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.control.supervision import Event
from omnidrive.errors import RunFailed


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
        command: Body twist commanded at ``t``, before wheel saturation; m/s, m/s, rad/s.
        twist: True body twist, as ``command``.
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
