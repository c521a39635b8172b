"""The closed loop, and the log it leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import isfinite, nan
from time import get_clock_info, perf_counter_ns, thread_time_ns

import numpy as np
from jaxtyping import Float, Int

from omnidrive.control import Command, Controller, DetailedController, Status
from omnidrive.errors import InvalidInput, PlantLost, RunFailed
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Reference
from omnidrive.simulation.plant import Plant
from omnidrive.simulation.sensing import PerfectSensor, Sensor

Array = np.ndarray

# a thread's own time is not disturbed by other processes; some systems count it too coarsely
_clock = thread_time_ns if get_clock_info("thread_time").resolution < 1e-6 else perf_counter_ns
_STOP = Command(BodyTwist(0.0, 0.0, 0.0))


class Outcome(Enum):
    """Why the loop stopped."""

    FINISHED = "reached the end of the reference"
    CONTROLLER_FAILED = "the controller had no usable command"
    PLANT_FAILED = "the plant's state is not finite"
    PLANT_LOST = "the plant was lost"


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
        reason: What more there is to say of that; often nothing.
        details: Inner numbers of a :class:`~omnidrive.control.DetailedController` at each sample,
            by name; NaN where it gave none, as in the last row.
        detail_units: The unit of each.
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
    reason: str = ""
    details: dict[str, Float[Array, " rows"]] = field(default_factory=dict)
    detail_units: dict[str, str] = field(default_factory=dict)

    @property
    def ending(self) -> str:
        """Why the loop stopped, with the reason where there is one."""
        return f"{self.outcome.value}: {self.reason}" if self.reason else self.outcome.value

    def raise_if_failed(self) -> Run:
        """Return self, or raise :class:`RunFailed` if the loop stopped early."""
        if self.outcome is not Outcome.FINISHED:
            raise RunFailed(f"stopped at {self.t[-1]:g} s: {self.ending}")
        return self


def simulate(
    plant: Plant,
    controller: Controller,
    reference: Reference,
    *,
    start: Pose,
    dt: float,
    sensor: Sensor | None = None,
) -> Run:
    """Close the loop until the reference ends.

    Args:
        plant: What moves.
        controller: What decides.
        reference: What is wanted.
        start: Pose at which the robot stands at t = 0.
        dt: Sample time in s; the reference ends on the nearest multiple.
        sensor: What the controller sees; the true pose by default.

    Raises:
        InvalidInput: ``dt`` is not a positive number of seconds, or a command holds more or fewer
            details than the controller announces.
    """
    if not (isfinite(dt) and dt > 0.0):
        raise InvalidInput(f"the sample time must be positive, got {dt:g} s")
    sensor = sensor or PerfectSensor()
    units = controller.detail_units if isinstance(controller, DetailedController) else {}
    rows: list[tuple[float, ...]] = []
    details: list[tuple[float, ...]] = []
    outcome, reason = Outcome.FINISHED, ""
    last = round(reference.duration / dt)

    controller.reset(start)
    controller.step(0.0, start, reference)  # compiles what has to be, outside the measured time
    state = plant.reset(start)
    sensor.reset(start)
    controller.reset(start)
    for k in range(last + 1):
        t = k * dt  # never a running sum: it drifts
        measured = sensor.sense(t, state)
        command, step_time = _STOP, float("nan")
        if k < last:
            began = _clock()
            command = controller.step(t, measured.pose, reference)
            step_time = (_clock() - began) * 1e-3
        target = reference.at(t).pose
        rows.append(
            (t, *state.pose, *measured.pose, *target, *command.twist, *state.twist, state.work,
             step_time, command.status, state.collisions, measured.position_sigma,
             measured.yaw_sigma)
        )  # fmt: skip
        details.append(command.details)
        if command.status is Status.FAILED or not all(map(isfinite, command.twist)):
            outcome = Outcome.CONTROLLER_FAILED
            break
        if k < last:
            try:
                state = plant.step(command.twist, dt)
            except PlantLost as error:
                outcome, reason = Outcome.PLANT_LOST, str(error)
                break
            if not all(map(isfinite, (*state.pose, *state.twist))):
                outcome = Outcome.PLANT_FAILED
                break
    return _log(np.array(rows, dtype=float), (outcome, reason), details, units)


def _log(
    rows: Float[Array, "rows 22"],
    ending: tuple[Outcome, str],
    details: Sequence[tuple[float, ...]],
    units: Mapping[str, str],
) -> Run:
    pose, measured, target, command, twist = (rows[:, i : i + 3] for i in range(1, 16, 3))
    return Run(
        t=rows[:, 0],
        pose=pose,
        measured=measured,
        position_sigma=rows[:, 20],
        yaw_sigma=rows[:, 21],
        target=target,
        command=command,
        twist=twist,
        work=rows[:, 16],
        step_time=rows[:, 17],
        status=rows[:, 18].astype(np.int64),
        collisions=rows[:, 19].astype(np.int64),
        outcome=ending[0],
        reason=ending[1],
        details=_detail_columns(details, units),
        detail_units=dict(units),
    )


def _detail_columns(
    details: Sequence[tuple[float, ...]], units: Mapping[str, str]
) -> dict[str, Float[Array, " rows"]]:
    if not units:  # nobody says what they are
        return {}
    none = (nan,) * len(units)
    for row in details:
        if row and len(row) != len(units):
            raise InvalidInput(
                f"the controller's commands hold {len(row)} details, its detail_units {len(units)}"
            )
    columns = np.array([row or none for row in details], dtype=float)
    return {name: columns[:, i] for i, name in enumerate(units)}
