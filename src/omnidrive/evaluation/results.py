"""What a study found: the input of tables, figures and pages."""

from __future__ import annotations

from dataclasses import dataclass

from omnidrive.evaluation.metrics import Metrics
from omnidrive.evaluation.recovery import Recovery, recovery
from omnidrive.evaluation.step_response import StepResponse
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path, SplinePath
from omnidrive.robot import Robot
from omnidrive.simulation import Fault, Run

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
class FaultResult:
    """One run of the task `faults`.

    Attributes:
        controller: Which controller.
        number: Which fault of the task, counted from 1; 0: none.
        fault: What went wrong; None: nothing did.
        duration: Of the reference, in s.
        run: The log.
        metrics: Its numbers.
    """

    controller: str
    number: int
    fault: Fault | None
    duration: float
    run: Run
    metrics: Metrics

    @property
    def name(self) -> str:
        """Unique in its study: also the stem of its time-series file."""
        fault = f"{self.number:02d}-{self.fault.kind}" if self.fault else "00-none"
        return f"faults-{self.controller}-{fault}"


@dataclass(frozen=True, eq=False, slots=True)
class StudyResults:
    """Everything that a finished study knows.

    Attributes:
        title: One line that names the study.
        robot: The robot that drove.
        plant: Which plant: rollers, ball, planar or kinematic.
        dt: Sample time of the controllers, in s.
        obstacles: What the robot's body must not touch.
        free_space: The inflated map, whose free cells the robot's centre may enter.
        grid_path: Cells found by the search, as poses.
        spline: The smooth path.
        tracks: Every tracking run.
        steps: Every step response.
        faults: Every run of the task `faults`.
    """

    title: str
    robot: Robot
    plant: str
    dt: float
    obstacles: OccupancyGrid
    free_space: OccupancyGrid
    grid_path: Path
    spline: SplinePath
    tracks: tuple[TrackResult, ...]
    steps: tuple[StepResult, ...]
    faults: tuple[FaultResult, ...] = ()

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

    @property
    def recoveries(self) -> tuple[tuple[FaultResult, Recovery], ...]:
        """Every run with a fault, and how it went on, in the order of the faults.

        Those whose controller has not yet driven without a fault are left out.
        """
        undisturbed = {r.controller: r.run for r in self.faults if r.fault is None}
        return tuple(
            (r, recovery(r.run, undisturbed[r.controller], r.fault.at))
            for r in sorted(self.faults, key=lambda r: r.number)
            if r.fault is not None and r.controller in undisturbed
        )
