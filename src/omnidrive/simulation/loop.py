"""The closed loop."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan
from time import get_clock_info, perf_counter_ns, thread_time_ns

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import Command, Controller, DetailedController, Status
from omnidrive.control.supervision import Event, Seen, Supervisor, Unsupervised
from omnidrive.errors import InvalidInput, PlantLost
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.parameter import check_sample_time
from omnidrive.reference import Reference
from omnidrive.simulation.conditions import Conditions, SensorConditions
from omnidrive.simulation.faults import Schedule
from omnidrive.simulation.faults.perception import Perception
from omnidrive.simulation.plant import DisturbablePlant, Measurement, Plant
from omnidrive.simulation.run import Outcome, Run
from omnidrive.simulation.sensing import Estimate, PerfectSensor, Sensor

# a thread's own time is not disturbed by other processes; some systems count it too coarsely
_clock = thread_time_ns if get_clock_info("thread_time").resolution < 1e-6 else perf_counter_ns
_STOP = Command(BodyTwist(0.0, 0.0, 0.0))
_BEFORE = -1.0  # s; a time before the first sample


def simulate(
    plant: Plant,
    controller: Controller,
    reference: Reference,
    *,
    start: Pose,
    dt: float,
    sensor: Sensor | None = None,
    schedule: Schedule | None = None,
    supervisor: Supervisor | None = None,
    rng: np.random.Generator | None = None,
) -> Run:
    """Close the loop until the reference ends.

    Args:
        plant: What moves.
        controller: What decides.
        reference: What is wanted.
        start: Pose at which the robot stands at t = 0.
        dt: Sample time in s; the reference ends on the nearest multiple.
        sensor: What the controller sees; the true pose by default.
        schedule: What goes wrong, and when; nothing by default.
        supervisor: Who stops the robot in time, and makes up for wheels that fail; nobody by
            default.
        rng: What jitter of the sample time is drawn from; without it there is none.

    Raises:
        InvalidInput: ``dt`` is not a positive number of seconds, a fault begins after the end or
            befalls a plant that knows none, or a command holds more or fewer details than the
            controller announces.
    """
    check_sample_time(dt)
    guard = supervisor or Unsupervised()
    around = _Surroundings(plant, Perception(sensor or PerfectSensor()), reference, schedule)
    around.check()
    controller.reset(start)
    controller.step(0.0, start, reference)  # compiles what has to be, outside the measured time
    state = plant.reset(start)
    around.perception.sensor.reset(start)
    controller.reset(start)
    guard.reset()
    return _driven(around, controller, guard, state, _samples(schedule, reference, dt, rng))


def _driven(
    around: _Surroundings,
    controller: Controller,
    guard: Supervisor | Unsupervised,
    state: Measurement,
    samples: Iterable[tuple[float, float, bool]],
) -> Run:
    """Sample by sample: perceive, judge, decide, act; all else is ready."""
    log, outcome, lost = _Log(_units(controller)), Outcome.FINISHED, ""
    before, asked, lasted = _BEFORE, _STOP.twist, 0.0
    for t, h, ends in samples:
        measured, seen = around.perceive(t, state)
        target = around.reference.at(t).pose
        if before != _BEFORE:
            guard.feel(t, asked, lasted, seen)
        shown = guard.look(t, seen, target)
        command, step_time = _STOP, nan
        if not (ends or guard.stopped):
            pilot = guard.controller or controller
            command, step_time = _timed_step(pilot, t, shown, around.reference)
        if not ends:
            command = guard.allow(around.in_time(t, command), h)
        log.add(t, state, measured, target, command, step_time)
        if command.status is Status.FAILED or not all(map(isfinite, command.twist)):
            outcome = Outcome.CONTROLLER_FAILED
            break
        if ends or (guard.at_rest and asked == _STOP.twist):
            break
        around.impose(before, t)
        try:
            state = around.plant.step(command.twist, h)
        except PlantLost as error:
            outcome, lost = Outcome.PLANT_LOST, str(error)
            break
        before, asked, lasted = t, command.twist, h
        if not all(map(isfinite, (*state.pose, *state.twist))):
            outcome = Outcome.PLANT_FAILED
            break
    return log.run((outcome, lost), around.events, guard)


def _samples(
    schedule: Schedule | None, reference: Reference, dt: float, rng: np.random.Generator | None
) -> Iterator[tuple[float, float, bool]]:
    """Time of every sample, time to the next, both in s, and whether it is the last."""
    if schedule is not None:
        yield from schedule.samples(reference.duration, dt, rng)
        return
    last = round(reference.duration / dt)
    for k in range(last + 1):
        yield k * dt, dt, k == last  # never a running sum: it drifts


def _timed_step(
    controller: Controller, t: float, pose: Pose, reference: Reference
) -> tuple[Command, float]:
    """The controller's command, and its computing time in us."""
    began = _clock()
    command = controller.step(t, pose, reference)
    return command, (_clock() - began) * 1e-3


def _units(controller: Controller) -> Mapping[str, str]:
    return controller.detail_units if isinstance(controller, DetailedController) else {}


@dataclass(slots=True)
class _Surroundings:
    """What befalls the robot and its sensors in a run."""

    plant: Plant
    perception: Perception
    reference: Reference
    schedule: Schedule | None
    events: list[Event] = field(default_factory=list)
    _holding: list[str] = field(default_factory=list)
    _imposed: Conditions = field(default_factory=Conditions)
    _late: Command = _STOP

    def check(self) -> None:
        """Refuse faults that cannot be."""
        if self.schedule is None:
            return
        self.schedule.check(self.reference.duration)
        if self.schedule.on_the_plant and not isinstance(self.plant, DisturbablePlant):
            raise InvalidInput(
                f"nothing can befall this plant, so no {', '.join(self.schedule.on_the_plant)}; "
                "take the plant rollers, ball or planar"
            )

    def perceive(self, t: float, state: Measurement) -> tuple[Estimate, Seen]:
        """What the robot believes of its pose, and all that it knows of itself."""
        conditions = SensorConditions() if self.schedule is None else self.schedule.sensors(t)
        found = self.perception.sense(t, state, conditions)
        angles = self.perception.encoders(state, conditions)
        seen = Seen(found.pose, found.position_sigma, found.age, angles, state.wheel_torques)
        return found, seen

    def in_time(self, t: float, command: Command) -> Command:
        """The command that acts from ``t`` (s) on: that of the sample before in an overrun."""
        late, self._late = self._late, command
        return late if self.schedule is not None and self.schedule.overrun(t) else command

    def impose(self, before: float, t: float) -> None:
        """Let happen what happens at ``t`` (s), when the sample before was at ``before``."""
        if self.schedule is None:
            return
        for fault in self.schedule.faults:
            if fault.holds(t) != fault.holds(before):
                does = "begins" if fault.holds(t) else "ends"
                self.events.append(Event(t, f"{fault.kind} {does}"))
        conditions = self.schedule.conditions(before, t, self.reference)
        at_once = any(conditions.impulse) or any(conditions.jump)
        if (at_once or conditions != self._imposed) and isinstance(self.plant, DisturbablePlant):
            self.plant.impose(conditions)
            self._imposed = conditions


@dataclass(slots=True)
class _Log:
    """Rows, as they come."""

    units: Mapping[str, str]
    rows: list[tuple[float, ...]] = field(default_factory=list)
    details: list[tuple[float, ...]] = field(default_factory=list)

    def add(  # noqa: PLR0917 - a row is what it is
        self,
        t: float,
        state: Measurement,
        measured: Estimate,
        target: Pose,
        command: Command,
        step_time: float,
    ) -> None:
        """Append one sample."""
        self.rows.append(
            (t, *state.pose, *measured.pose, *target, *command.twist, *state.twist, state.work,
             step_time, command.status, state.collisions, measured.position_sigma,
             measured.yaw_sigma)
        )  # fmt: skip
        self.details.append(command.details)

    def run(
        self, ending: tuple[Outcome, str], events: Sequence[Event], guard: Supervisor | Unsupervised
    ) -> Run:
        """All rows as columns."""
        rows = np.array(self.rows, dtype=float)
        pose, measured, target, command, twist = (rows[:, i : i + 3] for i in range(1, 16, 3))
        outcome, reason = ending[0], guard.stopped or ending[1]
        if reason and outcome is Outcome.FINISHED:
            outcome = Outcome.STOPPED
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
            outcome=outcome,
            details=_detail_columns(self.details, self.units),
            detail_units=dict(self.units),
            events=tuple(sorted((*events, *guard.events), key=lambda event: event.t)),
            reason=reason,
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
