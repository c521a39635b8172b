"""Runs of a study, and their simulation."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from omnidrive import visualization  # imports only the modules in use
from omnidrive.choices import TaskName
from omnidrive.control import Command, Controller, Status
from omnidrive.control.components import ControllerContext
from omnidrive.control.controller import check_controller
from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits, WheelMonitor
from omnidrive.errors import ComponentFailed, InvalidInput
from omnidrive.estimation import EncoderSettings, LatestFix, State, StateEstimator
from omnidrive.estimation.components import EstimatorContext
from omnidrive.evaluation import FaultResult, StepResult, TrackResult, measure, step_response
from omnidrive.evaluation.results import fault_name, step_name, track_name
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Hold, Reference
from omnidrive.robot import Robot
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.plants import plant_of
from omnidrive.scenario.scenario import NEED_FORCES, Scenario
from omnidrive.simulation import (
    Fault,
    KinematicPlant,
    Outcome,
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

Result = TrackResult | StepResult | FaultResult
"""Result of one run."""


class Job(NamedTuple):
    """One run of a study."""

    task: TaskName
    controller: str
    """Label of the controller in the scenario."""
    duration: float
    """Duration of the reference, s; of a step response, the time that is simulated."""
    horizon: int | None = None
    """Prediction horizon in steps; None for a controller without one."""
    repeat: int = 0
    """Index of the repeat, from 0; part of the seed of the random numbers."""
    fault: int = 0
    """Number of the fault in the task ``faults``, from 1; 0: no fault, or another task."""


def jobs_of(scenario: Scenario) -> list[Job]:
    """Return all runs of the study, in the order of the results."""
    tasks, jobs = scenario.tasks, []
    horizon = partial(horizon_of, scenario)
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
    swept = _swept(scenario)
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


def horizon_of(scenario: Scenario, controller: str) -> int | None:
    """Return the horizon of the controller with a label, in steps; None: it has none."""
    return getattr(scenario.controllers[controller].parameters, "horizon", None)


def _swept(scenario: Scenario) -> str | None:
    """Return the label of the controller of the task `horizon`; None without a predictive one.

    With several, it is the holonomic one with the preset `recommended`, otherwise that of the
    paper, otherwise the first one.
    """
    preferred = "holonomic-nmpc" if scenario.preset == "recommended" else "unicycle-nmpc"
    labels = scenario.predictive
    return next(
        (n for n in labels if scenario.controllers[n].type == preferred), (*labels, None)[0]
    )


def faults_of(scenario: Scenario) -> tuple[Fault, ...]:
    """Return the faults of the task ``faults``; none if the study does not have this task.

    By default, one of every kind that the plant supports, from a quarter of the duration on.
    """
    task = scenario.tasks.faults
    if task is None or task.faults:
        return task.faults if task else ()
    unsupported = () if scenario.plant_capabilities.forces else NEED_FORCES
    return tuple(f for f in default_faults(0.25 * task.duration) if f.kind not in unsupported)


def job_name(planned: PlannedScenario, job: Job) -> str:
    """Return the name of the result of a run."""
    if job.task == "step":
        return step_name(job.controller)
    if job.task == "faults":
        return fault_name(job.controller, job.fault, _fault(planned, job))
    return track_name(job.task, job.controller, job.duration, job.horizon, job.repeat)


def run_job(
    planned: PlannedScenario, job: Job, observers: Sequence[visualization.Observer] = ()
) -> Result:
    """Simulate one run, during which the observers are called, and evaluate it.

    Raises:
        ComponentFailed: The factory of the plant or of the estimator raises an exception.
    """
    own, step = _copied(planned), job.task == "step"
    reference = reference_of(own, job)
    with plant_of(own, reference, job.repeat, on_map=not step, observers=observers) as plant:
        run = _simulate(own, job, plant, reference)
    return evaluate(planned, job, run)


def unfinished(planned: PlannedScenario, job: Job, outcome: Outcome, reason: str) -> Result:
    """Return the result of a run whose log is lost: one sample at the start.

    Args:
        planned: The planned scenario.
        job: The run.
        outcome: Why the run ended.
        reason: Reason in one line.
    """
    reference = reference_of(planned, job)
    run = simulate(
        KinematicPlant(planned.plant_robot),
        _FailedController(RuntimeError(reason)),
        reference,
        start=start_of(planned, job, reference),
        dt=planned.scenario.sample_time,
    )
    return evaluate(planned, job, replace(run, outcome=outcome, reason=reason, traceback=""))


def reference_of(planned: PlannedScenario, job: Job) -> Reference:
    """Return the motion to track.

    Raises:
        InvalidReference: The duration is too short for the limits of the robot.
    """
    task = planned.scenario.tasks.step
    if job.task != "step" or task is None:
        return planned.reference(job.duration)
    goal = Pose(*(a + b for a, b in zip(planned.start, task.displacement, strict=True)))
    return Hold(goal, job.duration)


def start_of(planned: PlannedScenario, job: Job, reference: Reference) -> Pose:
    """Return the true initial pose in W."""
    return planned.start if job.task == "step" else reference.at(0.0).pose


def _fault(planned: PlannedScenario, job: Job) -> Fault | None:
    """Return the fault of a run of the task ``faults``; None: a run without one."""
    return (None, *faults_of(planned.scenario))[job.fault]


def _copied(planned: PlannedScenario) -> PlannedScenario:
    """Return the plan for one run: a part that changes what it receives changes no other run."""
    names = ("robot", "plant_robot", "obstacles", "path", "motion")
    return replace(planned, **{name: deepcopy(getattr(planned, name)) for name in names})


def make_controller(
    scenario: Scenario,
    robot: Robot,
    label: str,
    horizon: int | None = None,
    rng: np.random.Generator | None = None,
) -> Controller:
    """Return a new controller of a scenario.

    Args:
        scenario: The scenario.
        robot: Model of the robot in the controller.
        label: Label of the controller.
        horizon: Value of its parameter ``horizon``, if it has one, in steps. None: that of the
            scenario.
        rng: Generator for the controller. None: one with the seed of the scenario.

    Raises:
        ComponentFailed: The factory raises an exception, or gives no controller for this scenario.
    """
    configured = scenario.controllers[label]
    if horizon is not None and configured.has_parameter("horizon"):
        configured = configured.with_values(horizon=horizon)
    context = ControllerContext(
        robot,
        scenario.sample_time,
        np.random.default_rng(scenario.seed) if rng is None else rng,
        scenario.preset,
        forces=scenario.plant_capabilities.forces,
        odometry=scenario.odometry,
    )
    controller: Controller = configured.make(context)
    try:
        check_controller(controller, scenario.sample_time)
    except InvalidInput as error:
        raise ComponentFailed(str(error)) from TypeError(str(error))
    return controller


class _FailedController:
    """Controller whose run ends with an exception before the first sample."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def prepare(self) -> None:
        """Raise the exception."""
        raise self.error

    def reset(self, state: State) -> None:
        """Do nothing; it is not called."""

    def step(self, t: float, state: State, reference: Reference) -> Command:
        """Return a failed command; it is not called."""
        return Command(BodyTwist(0.0, 0.0, 0.0), Status.FAILED)


def job_seed(scenario: Scenario, job: Job) -> list[int]:
    """Return the seed of the sensor noise; with 1 that of the jitter, with 2 the controller's."""
    return [scenario.seed, round(job.duration * 1e6), job.repeat]


def _simulate(planned: PlannedScenario, job: Job, plant: Plant, reference: Reference) -> Run:
    """Simulate one run with the supervisor.

    The random numbers are the same for every controller. They depend on the seed of the scenario,
    the duration in microseconds and the repeat. Trailing zeros of a short NumPy seed have no
    effect, so that repeat 0 has the random numbers of the seed without the repeat. The jitter of
    the sample time and the controller have generators of their own.

    Args:
        planned: The planned scenario.
        job: The run.
        plant: The plant.
        reference: The motion to track.
    """
    scenario, robot = planned.scenario, planned.robot
    fault = _fault(planned, job) if job.task == "faults" else None
    faults = (*scenario.faults, *((fault,) if fault else ()))
    seed = job_seed(scenario, job)
    sensor_rng, jitter_rng = np.random.default_rng(seed), np.random.default_rng([*seed, 1])
    controller_rng = np.random.default_rng([*seed, 2])
    controller: Controller
    try:
        controller = make_controller(scenario, robot, job.controller, job.horizon, controller_rng)
    except ComponentFailed as error:  # the other runs of the study go on
        controller = _FailedController(error.__cause__ or error)
    sensors = make_sensors(scenario, robot, sensor_rng, noise=job.task == "noise")
    return simulate(
        plant,
        controller,
        reference,
        start=start_of(planned, job, reference),
        dt=scenario.sample_time,
        sensors=sensors,
        estimator=make_estimator(scenario, robot, sensors),
        supervisor=make_supervisor(scenario, robot),
        schedule=Schedule(faults, robot) if faults else None,
        rng=jitter_rng,
    )


def evaluate(planned: PlannedScenario, job: Job, run: Run) -> Result:
    """Return the result of a simulated run."""
    if job.task == "step":
        start, goal = planned.start, reference_of(planned, job).at(0.0).pose
        x, y, heading = (
            step_response(run.t, run.pose[:, i], start[i], goal[i]) for i in range(len(goal))
        )
        return StepResult(job.controller, run, (x, y, heading))
    metrics = measure(run, planned.robot.drive)
    if job.task == "faults":
        fault = _fault(planned, job)
        return FaultResult(job.controller, job.fault, fault, job.duration, run, metrics)
    return TrackResult(
        job.controller, job.task, job.duration, job.task == "noise", job.horizon, run, metrics,
        planned.clearance(run.pose[:, :2]), job.repeat,
    )  # fmt: skip


def make_sensors(
    scenario: Scenario, robot: Robot, rng: np.random.Generator, *, noise: bool = False
) -> Sensors:
    """Return new simulated sensors; with ``noise``, the pose fixes have the paper's noise.

    If the scenario has no sensors section, the fixes are exact without ``noise``.
    """
    section = scenario.sensors
    if section is None:
        return PaperNoise(rng) if noise else PerfectSensors()
    settings = section.settings
    if noise and settings.fixes:
        settings = replace(settings, fixes=replace(settings.fixes, law="paper"))
    return SensorSuite(settings, robot.chassis, rng)


def make_estimator(scenario: Scenario, robot: Robot, sensors: Sensors) -> StateEstimator:
    """Return a new estimator for ``sensors``: LatestFix if the scenario defines none.

    Raises:
        ComponentFailed: The factory of the estimator raises an exception.
    """
    section = scenario.sensors
    if section is None or section.estimator is None or not isinstance(sensors, SensorSuite):
        return LatestFix()
    forces = scenario.plant_capabilities.forces
    estimator: StateEstimator = section.estimator.make(
        EstimatorContext(robot, sensors.settings, forces)
    )
    return estimator


def make_supervisor(scenario: Scenario, robot: Robot) -> SafetySupervisor:
    """Return a new supervisor with the watchdog and the wheel monitor of the scenario."""
    section = scenario.watchdog
    default = WatchdogLimits.of(robot)
    limits = WatchdogLimits(
        default.error if section.error is None else section.error,
        section.position_sigma,
        section.age,
        section.patience,
    )
    encoders = scenario.sensors.encoders if scenario.sensors else EncoderSettings()
    return SafetySupervisor(
        robot,
        Watchdog(limits) if section.enabled else None,
        WheelMonitor(robot, encoders) if scenario.wheel_monitor else None,
    )
