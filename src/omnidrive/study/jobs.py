"""The runs that a scenario asks for, and how one is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from omnidrive.control import (
    Controller,
    FeedforwardController,
    classical_pid,
    fuzzy_pid,
    holonomic_nmpc,
    unicycle_nmpc,
)
from omnidrive.control.nmpc.holonomic import Actuation
from omnidrive.evaluation import StepResult, TrackResult, measure, step_response
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.reference import Hold
from omnidrive.robot import Robot
from omnidrive.simulation import (
    KinematicPlant,
    MovingObstacle,
    MujocoPlant,
    PaperNoise,
    Plant,
    simulate,
)
from omnidrive.simulation.show import Onlooker, watched
from omnidrive.study.prepared import Prepared
from omnidrive.study.scenario import (
    PREDICTIVE,
    ControllerName,
    PlantName,
    Scenario,
    TaskName,
)


class Job(NamedTuple):
    """One run of a study."""

    task: TaskName
    controller: ControllerName
    duration: float
    """Of the reference, in s."""
    horizon: int | None = None
    """Prediction horizon of the NMPC, in steps; None for other controllers."""
    repeat: int = 0
    """Which of the task's random numbers, counted from 0."""


def jobs_of(scenario: Scenario) -> list[Job]:
    """Every run of the study, in the order in which results are listed."""
    tasks, jobs = scenario.tasks, []

    def horizon(name: ControllerName) -> int | None:
        return scenario.nmpc.horizon if name in PREDICTIVE else None

    for duration in tasks.track.durations if tasks.track else ():
        jobs += [Job("track", name, duration, horizon(name)) for name in scenario.controllers]
    if tasks.noise:
        jobs += [
            Job("noise", name, duration, horizon(name), repeat)
            for duration in tasks.noise.durations
            for repeat in range(tasks.noise.repeats)
            for name in scenario.controllers
        ]
    if tasks.step:
        seconds = tasks.step.duration
        jobs += [Job("step", name, seconds, horizon(name)) for name in scenario.controllers]
    order = PREDICTIVE[::-1] if scenario.preset == "recommended" else PREDICTIVE
    swept = next((name for name in order if name in scenario.controllers), None)
    if tasks.horizon and swept:
        seconds = tasks.horizon.duration
        jobs += [Job("horizon", swept, seconds, n) for n in tasks.horizon.horizons]
    return jobs


def run_job(
    prepared: Prepared, job: Job, onlookers: Sequence[Onlooker] = ()
) -> TrackResult | StepResult:
    """Do one run and measure it, while ``onlookers`` see it."""
    do = _step if job.task == "step" else _track
    return do(prepared, job, onlookers)


def make_controller(
    scenario: Scenario, robot: Robot, name: ControllerName, horizon: int | None = None
) -> Controller:
    """A fresh controller as the scenario asks for it; ``horizon`` (steps) overrides its own."""
    steps = horizon or scenario.nmpc.horizon
    dt, preset = scenario.sample_time, scenario.preset
    table: dict[ControllerName, Callable[[], Controller]] = {
        "pid": lambda: classical_pid(preset, dt),
        "fuzzy_t1": lambda: fuzzy_pid("t1", preset, dt),
        "fuzzy_t2": lambda: fuzzy_pid("t2", preset, dt),
        "fuzzy_t3": lambda: fuzzy_pid("t3", preset, dt),
        "nmpc": lambda: unicycle_nmpc(
            "paper" if preset == "recommended" else preset,
            dt,
            horizon=steps,
            solver=scenario.nmpc.solver,
        ),
        "feedforward": lambda: FeedforwardController(dt, scenario.feedforward),
        "recommended": lambda: holonomic_nmpc(
            robot.chassis,
            dt,
            horizon=steps,
            parameters=scenario.recommended.weights,
            solver=scenario.nmpc.solver,
            actuation=_actuation(scenario, robot),
        ),
    }
    return table[name]()


def _actuation(scenario: Scenario, robot: Robot) -> Actuation:
    """Of the robot on the scenario's plant: without masses it neither lags nor slips."""
    section = scenario.recommended
    if scenario.plant == "kinematic":
        return Actuation(robot.traction / section.traction)
    return Actuation.of(robot, section.traction, may_spin=section.may_spin)


def make_plant(
    robot: Robot,
    name: PlantName,
    *,
    rng: np.random.Generator | None = None,
    obstacles: OccupancyGrid | None = None,
    moving: Sequence[MovingObstacle] = (),
) -> Plant:
    """A fresh plant.

    Args:
        robot: What drives.
        name: Which plant.
        rng: What the rollers' first angles are drawn from, and
        obstacles: what stands around it, and
        moving: what moves there: of plants that have such things.
    """
    table: dict[PlantName, Callable[[], Plant]] = {
        "kinematic": lambda: KinematicPlant(robot),
        "ball": lambda: MujocoPlant(robot, "ball", obstacles=obstacles, moving=moving),
        "rollers": lambda: MujocoPlant(robot, "rollers", rng, obstacles=obstacles, moving=moving),
    }
    return table[name]()


def _plant_on_map(prepared: Prepared, job: Job) -> Plant:
    """The scenario's plant among its obstacles; every controller meets the same one."""
    scenario = prepared.scenario
    # apart from the numbers of the noise
    seed = np.random.SeedSequence(scenario.seed, spawn_key=(job.repeat,))
    return make_plant(
        prepared.robot,
        scenario.plant,
        rng=np.random.default_rng(seed) if scenario.robot.roller_phase else None,
        obstacles=prepared.obstacles,
        moving=[section.obstacle() for section in scenario.map.moving],
    )


def _track(prepared: Prepared, job: Job, onlookers: Sequence[Onlooker]) -> TrackResult:
    """Follow the path; with noise, every controller sees the same random numbers.

    Those of repeat 0 are those of ``[seed, duration]``: a zero at the end of a numpy seed of few
    words does not count.
    """
    scenario = prepared.scenario
    reference = prepared.reference(job.duration)
    noise = job.task == "noise"
    rng = np.random.default_rng([scenario.seed, round(job.duration * 1e6), job.repeat])
    run = simulate(
        watched(
            _plant_on_map(prepared, job),
            prepared.robot,
            reference,
            onlookers,
            obstacles=prepared.obstacles,
            moving=[section.obstacle() for section in scenario.map.moving],
        ),
        make_controller(scenario, prepared.robot, job.controller, job.horizon),
        reference,
        start=reference.at(0.0).pose,
        dt=scenario.sample_time,
        sensor=PaperNoise(rng) if noise else None,
    )
    return TrackResult(
        job.controller, job.task, job.duration, noise, job.horizon, run,
        measure(run, prepared.robot.drive), prepared.clearance(run.pose[:, :2]), job.repeat,
    )  # fmt: skip


def _step(prepared: Prepared, job: Job, onlookers: Sequence[Onlooker]) -> StepResult:
    """Let the reference jump from the start pose, on an empty floor."""
    scenario = prepared.scenario
    task = scenario.tasks.step
    assert task is not None
    start = prepared.start
    goal = Pose(*(a + b for a, b in zip(start, task.displacement, strict=True)))
    reference = Hold(goal, job.duration)
    plant = make_plant(prepared.robot, scenario.plant)
    run = simulate(
        watched(plant, prepared.robot, reference, onlookers),
        make_controller(scenario, prepared.robot, job.controller, job.horizon),
        reference,
        start=start,
        dt=scenario.sample_time,
    )
    x, y, heading = (
        step_response(run.t, run.pose[:, i], start[i], goal[i]) for i in range(len(goal))
    )
    return StepResult(job.controller, run, (x, y, heading))
