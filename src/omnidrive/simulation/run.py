"""The log that a closed loop leaves."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.control.supervision import Event
from omnidrive.errors import RunFailed


class Outcome(Enum):
    """Why the loop stopped."""

    FINISHED = "reached the end of the reference"
    CONTROLLER_FAILED = "the controller had no usable command"
    PLANT_FAILED = "the plant's state is not finite"
    PLANT_LOST = "the plant was lost"
    STOPPED = "the watchdog stopped the robot"


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """Log of one closed loop: one row per sample, the last at the end of the reference.

    Attributes:
        t: Time of each row, in s.
        pose: True pose of B in W; x and y in m, yaw in rad, unwrapped.
        measured: Pose that the controller saw, as ``pose``.
        position_sigma: Standard deviation of its position as far as it is known, in m.
        yaw_sigma: The same of its yaw, in rad.
        target: Reference pose, as ``pose``.
        command: Commanded body twist held from ``t``, before the wheels' limits; m/s, m/s, rad/s.
        twist: True body twist, as ``command``.
        work: Mechanical work of the motors so far, in J; NaN without forces.
        step_time: Computing time of ``Controller.step`` in its thread, in us; NaN in the last row.
        status: :class:`~omnidrive.control.Status` of each command.
        collisions: How often the body has begun to touch an obstacle.
        outcome: Why the loop stopped.
        details: Inner numbers of a :class:`~omnidrive.control.DetailedController` at each sample,
            by name; NaN where it gave none, as in the last row.
        detail_units: The unit of each.
        events: Faults that began or ended, and what a supervisor found and did, in order.
        reason: More about the outcome; may be empty.
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

    @property
    def ending(self) -> str:
        """Why the loop stopped, in words."""
        return self.outcome.value + (f": {self.reason}" if self.reason else "")

    def raise_if_failed(self) -> Run:
        """Return self, or raise :class:`RunFailed` if the loop stopped early."""
        if self.outcome is not Outcome.FINISHED:
            raise RunFailed(f"stopped at {self.t[-1]:g} s: {self.ending}")
        return self
