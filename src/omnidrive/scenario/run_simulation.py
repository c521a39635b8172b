"""Simulation of one run of a planned scenario."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace

import numpy as np

from omnidrive import visualization  # imports only the modules in use
from omnidrive.control import Controller
from omnidrive.errors import ComponentFailed
from omnidrive.geometry import Pose
from omnidrive.reference import Hold, Reference
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.plants import plant_of
from omnidrive.scenario.run_parts import (
    FailedController,
    make_controller,
    make_estimator,
    make_sensors,
    make_supervisor,
)
from omnidrive.scenario.run_settings import RunSettings, fault_of, run_seed
from omnidrive.simulation import Plant, Run, Schedule, simulate


def simulate_run(
    planned: PlannedScenario,
    settings: RunSettings,
    observers: Sequence[visualization.Observer] = (),
) -> Run:
    """Simulate one run, during which the observers are called, and return its log.

    Raises:
        ComponentFailed: The factory of the plant or of the estimator raises an exception.
    """
    own, step = _copied(planned), settings.task == "step"
    reference = reference_of(own, settings)
    with plant_of(own, reference, settings.repeat, on_map=not step, observers=observers) as plant:
        return _simulate(own, settings, plant, reference)


def reference_of(planned: PlannedScenario, settings: RunSettings) -> Reference:
    """Return the motion to track.

    Raises:
        InvalidReference: The duration is too short for the limits of the robot.
    """
    task = planned.scenario.tasks.step
    if settings.task != "step" or task is None:
        return planned.reference(settings.duration)
    goal = Pose(*(a + b for a, b in zip(planned.start, task.displacement, strict=True)))
    return Hold(goal, settings.duration)


def start_of(planned: PlannedScenario, settings: RunSettings, reference: Reference) -> Pose:
    """Return the true initial pose in W."""
    return planned.start if settings.task == "step" else reference.at(0.0).pose


def _copied(planned: PlannedScenario) -> PlannedScenario:
    """Return the plan for one run: a part that changes what it receives changes no other run."""
    names = ("robot", "plant_robot", "obstacles", "path", "motion")
    return replace(planned, **{name: deepcopy(getattr(planned, name)) for name in names})


def _simulate(
    planned: PlannedScenario, settings: RunSettings, plant: Plant, reference: Reference
) -> Run:
    """Simulate one run with the supervisor.

    The random numbers are the same for every controller. They depend on the seed of the scenario,
    the duration in microseconds and the repeat. Trailing zeros of a short NumPy seed have no
    effect, so that repeat 0 has the random numbers of the seed without the repeat. The jitter of
    the sample time and the controller have generators of their own.

    Args:
        planned: The planned scenario.
        settings: The run.
        plant: The plant.
        reference: The motion to track.
    """
    scenario, robot = planned.scenario, planned.robot
    fault = fault_of(scenario, settings) if settings.task == "faults" else None
    faults = (*scenario.faults, *((fault,) if fault else ()))
    seed = run_seed(scenario, settings)
    sensor_rng, jitter_rng = np.random.default_rng(seed), np.random.default_rng([*seed, 1])
    controller_rng = np.random.default_rng([*seed, 2])
    controller: Controller
    try:
        controller = make_controller(
            scenario, robot, settings.controller, settings.horizon, controller_rng
        )
    except ComponentFailed as error:  # the other runs of the study go on
        controller = FailedController(error.__cause__ or error)
    sensors = make_sensors(scenario, robot, sensor_rng, noise=settings.task == "noise")
    return simulate(
        plant,
        controller,
        reference,
        start=start_of(planned, settings, reference),
        dt=scenario.sample_time,
        sensors=sensors,
        estimator=make_estimator(scenario, robot, sensors),
        supervisor=make_supervisor(scenario, robot),
        schedule=Schedule(faults, robot) if faults else None,
        rng=jitter_rng,
    )
