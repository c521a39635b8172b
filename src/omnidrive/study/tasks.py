"""What the controllers of a study have to do."""

from __future__ import annotations

from itertools import chain
from math import pi
from typing import Annotated, Literal

from pydantic import Field, model_validator

from omnidrive.parameter import Bounds
from omnidrive.simulation.disturbances import Fault
from omnidrive.study.section import Section, UniqueItems

TaskName = Literal["track", "noise", "step", "horizon", "faults"]

MAX_FAULTS = 100
"""Most faults of one run, and most runs with a fault of one controller."""

Seconds = Annotated[float, Bounds(0.1, 36_000.0, "s")]
Horizon = Annotated[int, Bounds(1, 200, "steps")]
_Metres = Annotated[float, Bounds(-100.0, 100.0, "m")]


class DurationsTask(Section):
    """Follow the path in each of several times."""

    durations: Annotated[tuple[Seconds, ...], Field(min_length=1, max_length=20), UniqueItems]


class NoiseTask(DurationsTask):
    """The same with the paper's noise on the measured pose."""

    repeats: Annotated[int, Bounds(1, 200, "seeds")] = 1
    """How many times, each with other random numbers; every controller meets the same ones."""


class StepTask(Section):
    """Stand still, then let the reference jump in x, y (m) and heading (rad) at once."""

    displacement: tuple[_Metres, _Metres, Annotated[float, Bounds(-pi, pi, "rad")]]
    duration: Seconds


class HorizonTask(Section):
    """Follow the path with NMPC of several prediction horizons."""

    duration: Seconds
    horizons: Annotated[tuple[Horizon, ...], Field(min_length=1, max_length=50), UniqueItems]


Faults = Annotated[tuple[Fault, ...], Field(max_length=MAX_FAULTS)]


class FaultsTask(Section):
    """Follow the path once as it is, and once with each of several faults."""

    duration: Seconds
    faults: Faults = ()
    """None: one of every kind, all beginning after a quarter of the time."""


class Tasks(Section):
    """What the controllers have to do; None leaves a task out."""

    track: DurationsTask | None = None
    noise: NoiseTask | None = None
    step: StepTask | None = None
    horizon: HorizonTask | None = None
    faults: FaultsTask | None = None

    @model_validator(mode="after")
    def _something_to_do(self) -> Tasks:
        if not any((self.track, self.noise, self.step, self.horizon, self.faults)):
            raise ValueError("names no task; there are track, noise, step, horizon and faults")
        return self

    @property
    def path_durations(self) -> tuple[float, ...]:
        """Every duration in which the path is followed, in s."""
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
        """Seconds that each controller drives with noise, all repeats of the longest together."""
        return self.noise.repeats * max(self.noise.durations) if self.noise else 0.0


def study_tasks(duration: float) -> Tasks:
    """The paper's tasks for a path to be followed in ``duration`` and 1.5 ``duration`` seconds."""
    slower = round(1.5 * duration, 6)
    return Tasks(
        track=DurationsTask(durations=(duration, slower)),
        noise=NoiseTask(durations=(slower,)),
        step=StepTask(displacement=(1.0, 1.0, 0.25 * pi), duration=10.0),
        horizon=HorizonTask(duration=duration, horizons=(5, 10, 15, 20, 25, 30)),
    )
