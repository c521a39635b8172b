"""Results of a study: the input of tables, figures and the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from omnidrive.evaluation.metrics import Metrics
from omnidrive.evaluation.recovery import Recovery, recovery
from omnidrive.evaluation.step_response import StepResponse
from omnidrive.fuzzy import FuzzySystem
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path, SplinePath
from omnidrive.reference import ReferencePath
from omnidrive.robot import Robot
from omnidrive.simulation import Fault, Run


@dataclass(frozen=True, eq=False, slots=True)
class TrackResult:
    """One tracking run.

    Attributes:
        controller: Label of the controller in the scenario, such as fuzzy_t1.
        task: Task of the study: track, noise or horizon.
        duration: Duration of the reference, s.
        noise: Whether the controller received noisy poses.
        horizon: Prediction horizon in steps; None for a controller without a horizon.
        run: Log of the run.
        metrics: Metrics of the run.
        min_clearance: Minimum distance between the robot's body and an obstacle, m; negative if
            they overlap.
        repeat: Index of the noise seed, counted from 0.
    """

    controller: str
    task: str
    duration: float
    noise: bool
    horizon: int | None
    run: Run
    metrics: Metrics
    min_clearance: float
    repeat: int = 0

    @property
    def collisions(self) -> int:
        """Number of collisions of the body with obstacles; 0 if the plant has no obstacles."""
        return int(self.run.collisions[-1])

    @property
    def is_late(self) -> bool:
        """Whether the controller followed the reference later than it asks, on its path."""
        return bool((self.run.details.get("reference_delay", np.zeros(1)) > 0.0).any())

    @property
    def name(self) -> str:
        """Name, unique in the study; also the stem of the time-series file."""
        return track_name(self.task, self.controller, self.duration, self.horizon, self.repeat)


@dataclass(frozen=True, eq=False, slots=True)
class StepResult:
    """One step response: the reference steps in x, y and heading at the same time.

    Attributes:
        controller: Label of the controller.
        run: Log of the run; the target is constant.
        responses: Step-response figures, of x, y and heading.
    """

    controller: str
    run: Run
    responses: tuple[StepResponse, StepResponse, StepResponse]

    @property
    def name(self) -> str:
        """Name, unique in the study; also the stem of the time-series file."""
        return step_name(self.controller)


@dataclass(frozen=True, eq=False, slots=True)
class FaultResult:
    """One run of the task ``faults``.

    Attributes:
        controller: Label of the controller.
        number: Number of the fault in the task, counted from 1; 0: run without a fault.
        fault: The injected fault; None: run without a fault.
        duration: Duration of the reference, s.
        run: Log of the run.
        metrics: Metrics of the run.
    """

    controller: str
    number: int
    fault: Fault | None
    duration: float
    run: Run
    metrics: Metrics

    @property
    def name(self) -> str:
        """Name, unique in the study; also the stem of the time-series file."""
        return fault_name(self.controller, self.number, self.fault)


def track_name(
    task: str, controller: str, duration: float, horizon: int | None, repeat: int
) -> str:
    """Return the name of a tracking run; see :class:`TrackResult`."""
    suffix = f"-N{horizon}" if task == "horizon" else ""
    seed = f"-r{repeat}" if repeat else ""
    return f"{task}-{controller}-{duration:g}s{suffix}{seed}"


def step_name(controller: str) -> str:
    """Return the name of a step response."""
    return f"step-{controller}"


def fault_name(controller: str, number: int, fault: Fault | None) -> str:
    """Return the name of a run of the task ``faults``; see :class:`FaultResult`."""
    kind = f"{number:02d}-{fault.kind}" if fault else "00-none"
    return f"faults-{controller}-{kind}"


class ControllerType(NamedTuple):
    """What is behind the label of a controller."""

    name: str
    """Name of the component, such as fuzzy_t1 or mine.py:Law."""
    description: str
    """Description in one line; may be empty."""
    parameters: str
    """Parameters other than the defaults, as text; empty: none."""
    fuzzy: FuzzySystem | None = None
    """Fuzzy system that tunes the gains; None: there is none of this package."""


@dataclass(frozen=True, eq=False, slots=True)
class StudyResults:
    """All results of a study.

    Attributes:
        title: Title, one line.
        robot: The simulated robot.
        plant: Name of the plant: mujoco-rollers, mujoco-balls, planar, kinematic or coppeliasim.
        dt: Sample time of the controllers, s.
        obstacles: Occupancy grid of the obstacles.
        free_space: The inflated map, whose free cells the robot's centre may enter.
        grid_path: Cells of the searched path, as poses; None for a reference that is not planned.
        spline: The smoothed path, or the path of a reference that is not planned.
        tracks: Tracking runs.
        steps: Step responses.
        faults: Runs of the task ``faults``.
        types: Type and parameters of each controller by its label; a label that is absent is its
            own type.
    """

    title: str
    robot: Robot
    plant: str
    dt: float
    obstacles: OccupancyGrid
    free_space: OccupancyGrid
    grid_path: Path | None
    spline: SplinePath | ReferencePath
    tracks: tuple[TrackResult, ...]
    steps: tuple[StepResult, ...]
    faults: tuple[FaultResult, ...] = ()
    types: Mapping[str, ControllerType] = field(default_factory=dict)

    @property
    def controllers(self) -> tuple[str, ...]:
        """Labels of all controllers, in the order of their first runs."""
        every: tuple[TrackResult | StepResult | FaultResult, ...] = (
            *self.tracks,
            *self.steps,
            *self.faults,
        )
        return tuple(dict.fromkeys(result.controller for result in every))

    def type_of(self, controller: str) -> str:
        """Return the type of a controller, by its label."""
        return self.types[controller].name if controller in self.types else controller

    @property
    def fuzzy_systems(self) -> dict[str, FuzzySystem]:
        """Gain-tuning system of each fuzzy controller of this package, by label."""
        found = {name: self.types[name].fuzzy for name in self.controllers if name in self.types}
        return {name: system for name, system in found.items() if system is not None}

    @property
    def runs(self) -> tuple[TrackResult | StepResult, ...]:
        """All tracking runs, then all step responses."""
        return (*self.tracks, *self.steps)

    def select(
        self, task: str, *, duration: float | None = None, repeat: int | None = 0
    ) -> tuple[TrackResult, ...]:
        """Return the tracking runs of one task, optionally of one duration (s), in order.

        Only runs with the given repeat are returned; ``repeat=None`` returns all.
        """
        return tuple(
            r
            for r in self.tracks
            if r.task == task and duration in (None, r.duration) and repeat in (None, r.repeat)
        )

    @property
    def repeats(self) -> int:
        """Number of noise seeds per controller."""
        return max((r.repeat for r in self.tracks), default=0) + 1

    @property
    def recoveries(self) -> tuple[tuple[FaultResult, Recovery], ...]:
        """Every run with a fault and its recovery, in the order of the faults.

        Runs of a controller without a fault-free run are omitted.
        """
        undisturbed = {r.controller: r.run for r in self.faults if r.fault is None}
        return tuple(
            (r, recovery(r.run, undisturbed[r.controller], r.fault.at))
            for r in sorted(self.faults, key=lambda r: r.number)
            if r.fault is not None and r.controller in undisturbed
        )
