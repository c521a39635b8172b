"""Samples of the runs of a batch: times, setpoints and faults."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.control import Controller, LimitedController, RetimingController
from omnidrive.control.compiled_law import SetpointWindow
from omnidrive.control.controller import limits_notice
from omnidrive.control.reference_window import ReferenceWindow
from omnidrive.control.supervision import Event
from omnidrive.errors import PART_ERRORS, InvalidInput
from omnidrive.reference import DelayedReference, Hold, Reference, RetimedReference
from omnidrive.reference.reference import WindowReference
from omnidrive.simulation.batch.loop import LATE, NO_SETPOINTS, SILENT, SampleArrays
from omnidrive.simulation.disturbances import Schedule
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.disturbances.fault import PeriodJitter, SilentSensor, SolverOverrun
from omnidrive.simulation.disturbances.schedule import sample_times

MAX_SAMPLES = 1_000_000
"""Most samples of one run."""
_MAX_KEPT = 4_000_000  # floats of the samples that are kept for further runs


class RunSamples(NamedTuple):
    """What runs on the same reference with the same faults have in common."""

    arrays: SampleArrays
    changes: tuple[tuple[int, Disturbances], ...]
    """Samples in which the disturbances of the plant change, and the new ones."""
    events: tuple[tuple[int, Event], ...]
    """Events in the order of ``simulate``, and the samples in which faults start or end; -1 for
    notices of the controller at the start."""


@dataclass(slots=True)
class Sampler:
    """Samples of runs; those of the last references and schedules are kept.

    Attributes:
        dt: Sample time, s.
        window: Setpoints that the law needs.
        controller: The controller, which may reach the end of a reference later.
    """

    dt: float
    window: SetpointWindow
    controller: Controller
    _kept: OrderedDict[tuple[int, int], tuple[object, object, RunSamples]] = field(
        default_factory=OrderedDict, init=False
    )
    _size: int = field(default=0, init=False)
    """Floats of the setpoints that are kept."""

    def samples(
        self,
        reference: Reference,
        schedule: Schedule | None,
        jitter: Callable[[], np.random.Generator],
    ) -> RunSamples:
        """Return the samples of a run.

        Args:
            reference: The motion to track.
            schedule: Its faults.
            jitter: Returns the generator of the jitter of this run.

        Raises:
            InvalidInput: The duration is not usable, or a fault begins after the end.
        """
        if schedule is not None and any(isinstance(f, PeriodJitter) for f in schedule.faults):
            return self._sample(reference, schedule, jitter())
        key = (id(reference), id(schedule))
        found = self._kept.get(key)
        if found is None:
            made = self._sample(reference, schedule, None)
            found = self._kept[key] = (reference, schedule, made)  # keeps the identities valid
            self._size += made.arrays.setpoints.size
            while len(self._kept) > 1 and self._size > _MAX_KEPT:
                _, (_, _, oldest) = self._kept.popitem(last=False)
                self._size -= oldest.arrays.setpoints.size
        else:
            self._kept.move_to_end(key)
        return found[2]

    def _sample(
        self, reference: Reference, schedule: Schedule | None, rng: np.random.Generator | None
    ) -> RunSamples:
        duration = reference.duration
        if not 0.0 <= duration <= MAX_SAMPLES * self.dt:
            raise InvalidInput(
                f"a run of a batch has at most {MAX_SAMPLES:,} samples, so a reference of up to "
                f"{MAX_SAMPLES * self.dt:g} s, got one of {duration:g} s"
            )
        if schedule is not None:
            schedule.check(duration)
        tracked, notices = reference, list[str]()
        if isinstance(self.controller, RetimingController):
            tracked, notice = self.controller.retime(reference)
            duration = max(duration, tracked.duration)
            notices.append(notice)
        if isinstance(self.controller, LimitedController):
            with suppress(*PART_ERRORS):  # of a reference; the run then fails in a sample
                notices.append(limits_notice(self.controller, reference, self.dt))
        if rng is None:
            times = self.dt * np.arange(round(duration / self.dt) + 1)
            steps = np.full(len(times), self.dt)
        else:
            faults = schedule.faults if schedule is not None else ()
            rows = np.array(list(sample_times(duration, self.dt, faults, rng)))
            times, steps = rows[:, 0].copy(), rows[:, 1].copy()
        even = rng is None and _is_ours(reference) and _is_ours(tracked)
        targets = self._targets(reference, times, even)
        found = self._setpoints(tracked, times, even)
        flags, changes, events = _faults(schedule, times, reference)
        flags[found.failed] |= NO_SETPOINTS
        late = tracked if isinstance(tracked, DelayedReference) else None
        delays = np.array([late.delay(t) if late else 0.0 for t in times.tolist()])
        arrays = SampleArrays(
            times, steps, targets, found.rows, self.window.length, found.first, found.last,
            delays, flags,
        )  # fmt: skip
        events += [(-1, Event(0.0, notice)) for notice in notices if notice]
        return RunSamples(arrays, changes, tuple(sorted(events, key=lambda each: each[1].t)))

    def _targets(
        self, reference: Reference, times: Float[Array, " samples"], even: bool
    ) -> Float[Array, "samples 3"]:
        """Return the poses of the reference; NaN where it raises an exception."""
        if even:  # all at once, with the same results
            with suppress(*PART_ERRORS):
                rows = reference.window(0.0, len(times), self.dt)
                return np.ascontiguousarray(rows[:, :3])
        targets = np.full((len(times), 3), np.nan)
        for k, t in enumerate(times.tolist()):
            with suppress(*PART_ERRORS):
                targets[k] = reference.at(t).pose
        return targets

    def _setpoints(
        self, tracked: Reference, times: Float[Array, " samples"], even: bool
    ) -> _Setpoints:
        """Return the setpoints of the motion that the controller tracks."""
        if self.window.ahead:
            return _setpoints_ahead(tracked, times, self.window)
        first, length, spacing = self.window[:3]
        count = len(times)
        if even:
            with suppress(*PART_ERRORS):
                columns = [
                    tracked.window(first + k * spacing, count, self.dt) for k in range(length)
                ]
                rows = np.ascontiguousarray(np.stack(columns, axis=1).reshape(-1, 6))
                return _Setpoints.of(rows, length * np.arange(count))
        setpoints, failed = np.full((count, length, 6), np.nan), np.zeros(count, bool)
        for k, t in enumerate(times.tolist()):
            try:
                if length == 1:
                    pose, twist = tracked.at(t + first)
                    setpoints[k, 0, :3], setpoints[k, 0, 3:] = pose, twist
                else:
                    setpoints[k] = tracked.window(t + first, length, spacing)
            except PART_ERRORS:
                failed[k] = True
        return _Setpoints.of(setpoints.reshape(-1, 6), length * np.arange(count), failed)


class _Setpoints(NamedTuple):
    rows: Float[Array, "rows 6"]
    first: Int[Array, " samples"]
    """Row of the first setpoint of each sample."""
    last: Int[Array, " samples"]
    """As :attr:`SampleArrays.last`."""
    failed: Bool[Array, " samples"]
    """Where the reference raises an exception."""

    @classmethod
    def of(
        cls,
        rows: Float[Array, "rows 6"],
        first: Int[Array, " samples"],
        failed: Bool[Array, " samples"] | None = None,
    ) -> _Setpoints:
        """Return setpoints for a law that does not use the end of the reference."""
        if failed is None:
            failed = np.zeros(len(first), bool)
        return cls(rows, first, np.zeros(len(first), np.int64), failed)


def _setpoints_ahead(
    tracked: Reference, times: Float[Array, " samples"], window: SetpointWindow
) -> _Setpoints:
    """Return the setpoints that a controller with a :class:`ReferenceWindow` uses."""
    finder, count = ReferenceWindow(window.length, window.spacing), len(times)
    first, last = np.zeros(count, np.int64), np.zeros(count, np.int64)
    blocks, failed, height = [finder.rows], np.zeros(count, bool), 0
    for k, t in enumerate(times.tolist()):
        begin = t + window.first
        try:
            row, last[k] = finder.find(begin, tracked)
        except PART_ERRORS:
            failed[k] = True
            continue
        if finder.rows is not blocks[-1]:
            height += len(blocks[-1])
            blocks.append(finder.rows)
        first[k] = height + row
    return _Setpoints(np.concatenate(blocks), first, last, failed)


def _is_ours(reference: Reference) -> bool:
    """Return whether ``at`` is a window of one setpoint, and equal to a row of a longer one."""
    if isinstance(reference, RetimedReference | DelayedReference):  # longer windows round otherwise
        return False
    at = getattr(type(reference), "at", None)
    return at is vars(WindowReference)["at"] or type(reference) is Hold


def _faults(
    schedule: Schedule | None, times: Float[Array, " samples"], reference: Reference
) -> tuple[
    Int[Array, " samples"],
    tuple[tuple[int, Disturbances], ...],
    list[tuple[int, Event]],
]:
    """Return the flags of every sample, the changes of the disturbances, and the events."""
    flags = np.zeros(len(times), np.int64)
    if schedule is None:
        return flags, (), []
    changes: set[int] = set()
    events: list[tuple[int, Event]] = []
    for fault in schedule.faults:
        start, end = fault.active_span
        active = (times >= start) & (times < end)
        flags[active] |= {SilentSensor: SILENT, SolverOverrun: LATE}.get(type(fault), 0)
        for k in np.flatnonzero(np.diff(active, prepend=False)).tolist():
            what = f"{fault.kind} {'begins' if active[k] else 'ends'}"
            events.append((k, Event(float(times[k]), what)))
            changes.add(k)
    applied, found = Disturbances(), []
    for k in sorted(changes):
        before = float(times[k - 1]) if k > 0 else -1.0
        disturbances = schedule.disturbances(before, float(times[k]), reference)
        at_once = any(disturbances.impulse) or any(disturbances.offset)
        if at_once or disturbances != applied:
            found.append((k, disturbances))
            applied = disturbances
    return flags, tuple(found), events
