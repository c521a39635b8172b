"""The runs that a scenario asks for, and how one is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
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
from omnidrive.estimation import LatestFix, PoseEstimator, StateEstimator
from omnidrive.evaluation import FaultResult, StepResult, TrackResult, measure, step_response
from omnidrive.geometry import Pose
from omnidrive.reference import Hold, Reference
from omnidrive.robot import Robot
from omnidrive.simulation import (
    Fault,
    PaperNoise,
    PerfectSensors,
    Plant,
    Run,
    Schedule,
    Sensors,
    SensorSuite,
    default_faults,
    simulate,
)
from omnidrive.study.planned_scenario import PlannedScenario
from omnidrive.study.plants import plant_of
from omnidrive.study.scenario import NEED_FORCES, PREDICTIVE, ControllerName, Scenario
from omnidrive.study.supervision import make_supervisor
from omnidrive.study.tasks import TaskName
from omnidrive.visualization import Observer


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
    fault: int = 0
    """Which fault of the task `faults`, counted from 1; 0: none."""


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
    if tasks.faults:
        seconds = tasks.faults.duration
        jobs += [
            Job("faults", name, seconds, horizon(name), fault=number)
            for number in range(len(faults_of(scenario)) + 1)
            for name in scenario.controllers
        ]
    return jobs


def faults_of(scenario: Scenario) -> tuple[Fault, ...]:
    """Those of the task `faults`: its own, or one of every kind that the plant knows."""
    task = scenario.tasks.faults
    if task is None or task.faults:
        return task.faults if task else ()
    unknown = () if scenario.plant_capabilities.forces else NEED_FORCES
    return tuple(f for f in default_faults(0.25 * task.duration) if f.kind not in unknown)


def run_job(
    planned: PlannedScenario, job: Job, observers: Sequence[Observer] = ()
) -> TrackResult | StepResult | FaultResult:
    """Do one run and measure it, while ``observers`` see it."""
    if job.task == "faults":
        return _fault(planned, job, observers)
    do = _step if job.task == "step" else _track
    return do(planned, job, observers)


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
        "unicycle-nmpc": lambda: unicycle_nmpc(
            "paper" if preset == "recommended" else preset,
            dt,
            horizon=steps,
            solver=scenario.nmpc.solver,
        ),
        "feedforward": lambda: FeedforwardController(dt, scenario.feedforward),
        "holonomic-nmpc": lambda: holonomic_nmpc(
            robot.chassis,
            dt,
            horizon=steps,
            parameters=scenario.holonomic_nmpc.weights,
            solver=scenario.nmpc.solver,
            actuation=_actuation(scenario, robot),
        ),
    }
    return table[name]()


def _actuation(scenario: Scenario, robot: Robot) -> Actuation:
    """Of the robot on the scenario's plant: without masses it neither lags nor slips."""
    section = scenario.holonomic_nmpc
    if not scenario.plant_capabilities.forces:
        return Actuation(robot.acceleration_faces / section.traction)
    return Actuation.of(robot, section.traction, may_spin=scenario.wheels_may_spin)


def _simulated(
    planned: PlannedScenario,
    job: Job,
    plant: Plant,
    reference: Reference,
    *,
    start: Pose | None = None,
    faults: tuple[Fault, ...] = (),
) -> Run:
    """One run under supervision, with the scenario's faults and others.

    Every controller meets the same random numbers. Those of repeat 0 are those of
    ``[seed, duration]``: a zero at the end of a numpy seed of few words does not count. Jitter's
    are apart from those of the sensors.
    """
    scenario, robot = planned.scenario, planned.robot
    controller = make_controller(scenario, robot, job.controller, job.horizon)
    every = (*scenario.faults, *faults)
    seed = [scenario.seed, round(job.duration * 1e6), job.repeat]
    sensing, jitter = np.random.default_rng(seed), np.random.default_rng([*seed, 1])
    sensors = make_sensors(scenario, robot, sensing, noise=job.task == "noise")
    return simulate(
        plant,
        controller,
        reference,
        start=start or reference.at(0.0).pose,
        dt=scenario.sample_time,
        sensors=sensors,
        estimator=make_estimator(scenario, robot, sensors),
        supervisor=make_supervisor(scenario, robot),
        schedule=Schedule(every, robot) if every else None,
        rng=jitter,
    )


def _fault(planned: PlannedScenario, job: Job, observers: Sequence[Observer]) -> FaultResult:
    """Follow the path with one fault of the task, or with none."""
    reference = planned.reference(job.duration)
    fault = (None, *faults_of(planned.scenario))[job.fault]
    faults = (fault,) if fault else ()
    with plant_of(planned, reference, observers=observers) as plant:
        run = _simulated(planned, job, plant, reference, faults=faults)
    metrics = measure(run, planned.robot.drive)
    return FaultResult(job.controller, job.fault, fault, job.duration, run, metrics)


def make_sensors(
    scenario: Scenario, robot: Robot, rng: np.random.Generator, *, noise: bool = False
) -> Sensors:
    """New simulated sensors; ``noise``: with the paper's noise on the pose."""
    section = scenario.sensors
    if section is None:
        return PaperNoise(rng) if noise else PerfectSensors()
    settings = section.settings
    if noise and settings.fixes:
        settings = replace(settings, fixes=replace(settings.fixes, law="paper"))
    return SensorSuite(settings, robot.chassis, rng)


def make_estimator(scenario: Scenario, robot: Robot, sensors: Sensors) -> StateEstimator:
    """A new estimator for the readings of ``sensors``."""
    section = scenario.sensors
    if section is None or section.estimator is None or not isinstance(sensors, SensorSuite):
        return LatestFix()
    slips = scenario.plant_capabilities.forces
    return PoseEstimator(robot, sensors.settings, section.estimator, slips=slips)


def _track(planned: PlannedScenario, job: Job, observers: Sequence[Observer]) -> TrackResult:
    """Follow the path."""
    reference = planned.reference(job.duration)
    with plant_of(planned, reference, job.repeat, observers=observers) as plant:
        run = _simulated(planned, job, plant, reference)
    return TrackResult(
        job.controller, job.task, job.duration, job.task == "noise", job.horizon, run,
        measure(run, planned.robot.drive), planned.clearance(run.pose[:, :2]), job.repeat,
    )  # fmt: skip


def _step(planned: PlannedScenario, job: Job, observers: Sequence[Observer]) -> StepResult:
    """Let the reference jump from the start pose, on an empty floor."""
    task = planned.scenario.tasks.step
    assert task is not None
    start = planned.start
    goal = Pose(*(a + b for a, b in zip(start, task.displacement, strict=True)))
    reference = Hold(goal, job.duration)
    with plant_of(planned, reference, on_map=False, observers=observers) as plant:
        run = _simulated(planned, job, plant, reference, start=start)
    x, y, heading = (
        step_response(run.t, run.pose[:, i], start[i], goal[i]) for i in range(len(goal))
    )
    return StepResult(job.controller, run, (x, y, heading))
