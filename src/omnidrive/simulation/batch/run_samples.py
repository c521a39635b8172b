"""Samples of the runs of a batch: times, setpoints and faults."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.control import Controller, RetimingController
from omnidrive.control.compiled_law import SetpointWindow
from omnidrive.control.supervision import Event
from omnidrive.errors import PART_ERRORS, InvalidInput
from omnidrive.reference import Hold, Reference
from omnidrive.reference.reference import WindowReference
from omnidrive.simulation.batch.loop import LATE, SILENT, SampleArrays
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
    """Samples in which faults start or end, and their events."""


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
        tracked, notices = reference, list[tuple[int, Event]]()
        if isinstance(self.controller, RetimingController):
            tracked, notice = self.controller.retime(reference)
            duration = max(duration, tracked.duration)
            notices += [(0, Event(0.0, notice))] if notice else []
        if rng is None:
            times = self.dt * np.arange(round(duration / self.dt) + 1)
            steps = np.full(len(times), self.dt)
            targets, setpoints = self._setpoints(reference, tracked, times)
        else:
            faults = schedule.faults if schedule is not None else ()
            rows = np.array(list(sample_times(duration, self.dt, faults, rng)))
            times, steps = rows[:, 0].copy(), rows[:, 1].copy()
            targets, setpoints = _each(reference, tracked, times, self.window)
        flags, changes, events = _faults(schedule, times, reference)
        arrays = SampleArrays(times, steps, targets, setpoints, flags)
        return RunSamples(arrays, changes, (*notices, *events))

    def _setpoints(
        self, reference: Reference, tracked: Reference, times: Float[Array, " samples"]
    ) -> tuple[Array, Array]:
        """Return targets, and setpoints of the motion that the controller tracks, at even times.

        References of this package are evaluated at all times at once, with the same results.
        """
        if not (_is_ours(reference) and _is_ours(tracked)):
            return _each(reference, tracked, times, self.window)
        first, length, spacing = self.window
        try:
            targets = reference.window(0.0, len(times), self.dt)[:, :3]
            columns = [
                tracked.window(first + k * spacing, len(times), self.dt) for k in range(length)
            ]
        except PART_ERRORS:
            return _each(reference, tracked, times, self.window)
        return np.ascontiguousarray(targets), np.ascontiguousarray(np.stack(columns, axis=1))


def _is_ours(reference: Reference) -> bool:
    """Return whether ``at`` is a window of one setpoint."""
    at = getattr(type(reference), "at", None)
    return at is vars(WindowReference)["at"] or type(reference) is Hold


def _each(
    reference: Reference,
    tracked: Reference,
    times: Float[Array, " samples"],
    window: SetpointWindow,
) -> tuple[Float[Array, "samples 3"], Float[Array, "samples count 6"]]:
    """Return targets and setpoints, evaluated sample by sample as ``simulate`` does it.

    They are NaN where the reference raises an exception.
    """
    first, length, spacing = window
    targets = np.full((len(times), 3), np.nan)
    setpoints = np.full((len(times), length, 6), np.nan)
    for k, t in enumerate(times.tolist()):
        try:
            targets[k] = reference.at(t).pose
            if length == 1:
                pose, twist = tracked.at(t + first)
                setpoints[k, 0, :3], setpoints[k, 0, 3:] = pose, twist
            else:
                setpoints[k] = tracked.window(t + first, length, spacing)
        except PART_ERRORS:
            continue
    return targets, setpoints


def _faults(
    schedule: Schedule | None, times: Float[Array, " samples"], reference: Reference
) -> tuple[
    Int[Array, " samples"],
    tuple[tuple[int, Disturbances], ...],
    tuple[tuple[int, Event], ...],
]:
    """Return the flags of every sample, the changes of the disturbances, and the events."""
    flags = np.zeros(len(times), np.int64)
    if schedule is None:
        return flags, (), ()
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
    return flags, tuple(found), tuple(sorted(events, key=lambda each: each[0]))
