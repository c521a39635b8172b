"""Tasks of a study."""

from __future__ import annotations

from itertools import chain
from math import pi
from typing import Annotated

from pydantic import Field, model_validator

from omnidrive.parameter import Bounds
from omnidrive.scenario.section import Section, UniqueItems
from omnidrive.simulation.disturbances import Fault

MAX_FAULTS = 100
"""Maximum number of faults of one run, and of faults of the task `faults`."""

DURATION = Bounds(0.1, 36_000.0, "s")
"""Range of the duration of a run."""

Seconds = Annotated[float, DURATION]
Horizon = Annotated[int, Bounds(1, 200, "steps")]
_Metres = Annotated[float, Bounds(-100.0, 100.0, "m")]


class DurationsTask(Section):
    """Follow the path, once for each of several durations."""

    durations: Annotated[tuple[Seconds, ...], Field(min_length=1, max_length=20), UniqueItems]
    """Durations of the path, s."""


class NoiseTask(DurationsTask):
    """Follow the path with the measurement noise of the paper on the pose."""

    repeats: Annotated[int, Bounds(1, 200, "seeds")] = 1
    """Number of runs with different noise; the noise is the same for every controller."""


class StepTask(Section):
    """Step response from rest at the start."""

    displacement: tuple[_Metres, _Metres, Annotated[float, Bounds(-pi, pi, "rad")]]
    """Step of the reference in x, y and heading in W; m, m, rad."""
    duration: Seconds
    """Duration of the run, s."""


class HorizonTask(Section):
    """Follow the path with several prediction horizons of an NMPC."""

    duration: Seconds
    """Duration of the path, s."""
    horizons: Annotated[tuple[Horizon, ...], Field(min_length=1, max_length=50), UniqueItems]
    """Prediction horizons, in steps of the sample time."""


Faults = Annotated[tuple[Fault, ...], Field(max_length=MAX_FAULTS)]


class FaultsTask(Section):
    """Follow the path once without a fault, and once with each of several faults."""

    duration: Seconds
    """Duration of the path, s."""
    faults: Faults = ()
    """Faults, each in a run of its own. Empty: one of every kind that the plant can simulate, each
    from a quarter of the duration on."""


class Tasks(Section):
    """Tasks of every controller. None: the study does not have this task."""

    track: DurationsTask | None = None
    """Follow the path."""
    noise: NoiseTask | None = None
    """Follow the path with measurement noise."""
    step: StepTask | None = None
    """Step response."""
    horizon: HorizonTask | None = None
    """Follow the path with several prediction horizons."""
    faults: FaultsTask | None = None
    """Follow the path with faults and disturbances."""

    @model_validator(mode="after")
    def _check_not_empty(self) -> Tasks:
        if not any((self.track, self.noise, self.step, self.horizon, self.faults)):
            raise ValueError("has no task; there are track, noise, step, horizon and faults")
        return self

    @property
    def path_durations(self) -> tuple[float, ...]:
        """Different durations of the path in all tasks, in s, in increasing order."""
        lists = (task.durations for task in (self.track, self.noise) if task)
        single = [task.duration for task in (self.horizon, self.faults) if task]
        return tuple(sorted({*chain.from_iterable(lists), *single}))

    @property
    def longest(self) -> float:
        """Duration of the longest run, in s."""
        return max((*self.path_durations, self.step.duration if self.step else 0.0))

    @property
    def shortest(self) -> float:
        """Duration of the shortest run, in s."""
        step = (self.step.duration,) if self.step else ()
        shortest: float = min((*self.path_durations, *step))
        return shortest

    @property
    def noise_duration(self) -> float:
        """Total duration of the longest noise runs of one controller, over all repeats, in s."""
        return self.noise.repeats * max(self.noise.durations) if self.noise else 0.0


def study_tasks(duration: float) -> Tasks:
    """Return the tasks of the paper for a path of ``duration`` and 1.5 ``duration`` seconds."""
    slower = round(1.5 * duration, 6)
    return Tasks(
        track=DurationsTask(durations=(duration, slower)),
        noise=NoiseTask(durations=(slower,)),
        step=StepTask(displacement=(1.0, 1.0, 0.25 * pi), duration=10.0),
        horizon=HorizonTask(duration=duration, horizons=(5, 10, 15, 20, 25, 30)),
    )
