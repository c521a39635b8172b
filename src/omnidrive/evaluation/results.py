"""What a study found: the input of tables, figures and pages."""

from __future__ import annotations

from dataclasses import dataclass

from omnidrive.evaluation.metrics import Metrics
from omnidrive.evaluation.step_response import StepResponse
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path, SplinePath
from omnidrive.robot import Robot
from omnidrive.simulation import Run

STEP_AXES = ("x", "y", "heading")


@dataclass(frozen=True, eq=False, slots=True)
class TrackResult:
    """One tracking run.

    Attributes:
        controller: Which controller, by its name in scenarios, such as fuzzy_t1.
        task: Which part of the study: track, noise or horizon.
        duration: Of the reference, in s.
        noise: Whether the controller saw noisy poses.
        horizon: Prediction horizon in steps; None for a controller that has none.
        run: The log.
        metrics: Its numbers.
        min_clearance: Least distance between the robot's body and an obstacle, in m; negative
            where they would overlap.
        repeat: Which of several runs with other random numbers, counted from 0.
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
        """How often the body ran into an obstacle, on a plant that has them."""
        return int(self.run.collisions[-1])

    @property
    def name(self) -> str:
        """Unique in its study: also the stem of its time-series file."""
        horizon = f"-N{self.horizon}" if self.task == "horizon" else ""
        repeat = f"-r{self.repeat}" if self.repeat else ""
        return f"{self.task}-{self.controller}-{self.duration:g}s{horizon}{repeat}"


@dataclass(frozen=True, eq=False, slots=True)
class StepResult:
    """One step response: the reference jumps in x, y and heading at once.

    Attributes:
        controller: Which controller.
        run: The log; its target is constant.
        responses: One per axis of :data:`STEP_AXES`.
    """

    controller: str
    run: Run
    responses: tuple[StepResponse, StepResponse, StepResponse]

    @property
    def name(self) -> str:
        """Unique in its study: also the stem of its time-series file."""
        return f"step-{self.controller}"


@dataclass(frozen=True, eq=False, slots=True)
class StudyResults:
    """Everything that a finished study knows.

    Attributes:
        title: One line that names the study.
        robot: The robot that drove.
        plant: Which plant: rollers, ball or kinematic.
        dt: Sample time of the controllers, in s.
        obstacles: What the robot's body must not touch.
        free: Where its centre may be.
        way: Cells found by the search, as poses.
        spline: The smooth path.
        tracks: Every tracking run.
        steps: Every step response.
    """

    title: str
    robot: Robot
    plant: str
    dt: float
    obstacles: OccupancyGrid
    free: OccupancyGrid
    way: Path
    spline: SplinePath
    tracks: tuple[TrackResult, ...]
    steps: tuple[StepResult, ...]

    @property
    def runs(self) -> tuple[TrackResult | StepResult, ...]:
        """Tracking runs, then step responses."""
        return (*self.tracks, *self.steps)

    def select(
        self, task: str, *, duration: float | None = None, repeat: int | None = 0
    ) -> tuple[TrackResult, ...]:
        """Tracking runs of one task, perhaps of one duration (s), in order.

        Of runs that were repeated, the first; ``repeat=None`` gives all.
        """
        return tuple(
            r
            for r in self.tracks
            if r.task == task and duration in (None, r.duration) and repeat in (None, r.repeat)
        )

    @property
    def repeats(self) -> int:
        """With how many seeds of the noise every controller drove."""
        return max((r.repeat for r in self.tracks), default=0) + 1
