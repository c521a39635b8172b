"""Logs of the runs of one scenario, and the place where they were recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.evaluation.plan_view import PlanView
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.fuzzy import FuzzySystem
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path, SplinePath
from omnidrive.reference import ReferencePath
from omnidrive.robot import Robot
from omnidrive.simulation import Fault, Run


class RecordedRun(NamedTuple):
    """One run: its record, and its log."""

    record: RunRecord
    log: Run

    @property
    def controller(self) -> str:
        """Label of the controller in the scenario."""
        return self.record.controller

    @property
    def task(self) -> str:
        """Task of the study: track, noise, step, horizon or faults."""
        return self.record.task

    @property
    def duration(self) -> float:
        """Duration of the reference, s."""
        return self.record.duration

    @property
    def horizon(self) -> int:
        """Prediction horizon of the task ``horizon``, in steps."""
        return int(self.record.variant.removeprefix("N = "))

    @property
    def name(self) -> str:
        """Name, unique in the study; also the stem of the time-series file."""
        return self.record.name

    @property
    def is_late(self) -> bool:
        """Whether the controller followed the reference later than it asks, on its path."""
        return bool((self.log.details.get("reference_delay", np.zeros(1)) > 0.0).any())


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
class StudyLogs:
    """Logs of the runs of one scenario: what figures and the player of the report show.

    Attributes:
        title: Title, one line.
        robot: The simulated robot.
        plant: Name of the plant: mujoco-rollers, mujoco-balls, planar, kinematic or coppeliasim.
        dt: Sample time of the controllers, s.
        obstacles: Occupancy grid of the obstacles.
        free_space: The inflated map, whose free cells the robot's centre may enter.
        grid_path: Cells of the searched path, as poses; None for a reference that is not planned.
        spline: The smoothed path, or the path of a reference that is not planned.
        runs: The runs whose logs are kept, in the order of the plan; of repeated runs the first.
        faults: Faults of the task ``faults``, by the variants of its runs.
        types: Type and parameters of each controller by its label; a label that is absent is its
            own type.
        repeats: Number of noise seeds per controller.
        plan: The motion along a planned path; None for a reference that is not planned.
    """

    title: str
    robot: Robot
    plant: str
    dt: float
    obstacles: OccupancyGrid
    free_space: OccupancyGrid
    grid_path: Path | None
    spline: SplinePath | ReferencePath
    runs: tuple[RecordedRun, ...]
    faults: Mapping[str, Fault] = field(default_factory=dict)
    types: Mapping[str, ControllerType] = field(default_factory=dict)
    repeats: int = 1
    plan: PlanView | None = None

    @property
    def controllers(self) -> tuple[str, ...]:
        """Labels of all controllers, in the order of their first runs."""
        return tuple(dict.fromkeys(each.controller for each in self.runs))

    def type_of(self, controller: str) -> str:
        """Return the type of a controller, by its label."""
        return self.types[controller].name if controller in self.types else controller

    @property
    def fuzzy_systems(self) -> dict[str, FuzzySystem]:
        """Gain-tuning system of each fuzzy controller of this package, by label."""
        found = {name: self.types[name].fuzzy for name in self.controllers if name in self.types}
        return {name: system for name, system in found.items() if system is not None}

    def select(self, *tasks: str, duration: float | None = None) -> tuple[RecordedRun, ...]:
        """Return the runs of some tasks, optionally of one duration (s), in order."""
        return tuple(
            each for each in self.runs if each.task in tasks and duration in {None, each.duration}
        )

    @property
    def late_durations(self) -> frozenset[float]:
        """Durations (s) of the task ``track`` in which a controller followed its reference late."""
        return frozenset(each.duration for each in self.select("track") if each.is_late)

    @property
    def limit_notes(self) -> list[str]:
        """Sentences on references that exceed the limits of controllers, each with its labels.

        Of each controller the shortest reference counts, which is the fastest.
        """
        fastest: dict[str, RecordedRun] = {}
        driven = self.select("track", "noise", "horizon", "faults")
        for each in sorted(driven, key=lambda each: each.duration):
            fastest.setdefault(each.controller, each)
        notes: dict[str, list[str]] = {}
        for label, each in fastest.items():
            for event in each.log.events:
                if event.what.endswith(FALLS_BEHIND):
                    text = f"In {each.duration:g} s, {event.what}"
                    notes.setdefault(text, []).append(label)
        return [f"{text} ({', '.join(labels)})." for text, labels in notes.items()]
