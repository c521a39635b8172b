"""Settings of the runs of a scenario: task, controller, duration, horizon, repeat and fault."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from omnidrive.choices import TaskName
from omnidrive.evaluation.run_record import name_of_run
from omnidrive.scenario.scenario import NEED_FORCES, Scenario
from omnidrive.simulation import Fault, default_faults


class RunSettings(NamedTuple):
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


def settings_of_runs(scenario: Scenario) -> list[RunSettings]:
    """Return all runs of the study, in the order of the results."""
    tasks, runs = scenario.tasks, []
    horizon = partial(horizon_of, scenario)
    for duration in tasks.track.durations if tasks.track else ():
        runs += [
            RunSettings("track", name, duration, horizon(name)) for name in scenario.controllers
        ]
    if tasks.noise:
        runs += [
            RunSettings("noise", name, duration, horizon(name), repeat)
            for duration in tasks.noise.durations
            for repeat in range(tasks.noise.repeats)
            for name in scenario.controllers
        ]
    if tasks.step:
        seconds = tasks.step.duration
        runs += [RunSettings("step", name, seconds, horizon(name)) for name in scenario.controllers]
    swept = _swept(scenario)
    if tasks.horizon and swept:
        seconds = tasks.horizon.duration
        runs += [RunSettings("horizon", swept, seconds, n) for n in tasks.horizon.horizons]
    if tasks.faults:
        seconds = tasks.faults.duration
        runs += [
            RunSettings("faults", name, seconds, horizon(name), fault=number)
            for number in range(len(faults_of(scenario)) + 1)
            for name in scenario.controllers
        ]
    return runs


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


def run_name(scenario: Scenario, settings: RunSettings) -> str:
    """Return the name of a run, see :func:`~omnidrive.evaluation.run_record.name_of_run`."""
    task, controller, duration = settings[:3]
    variant = task_variant(scenario, settings)
    return name_of_run(task, controller, duration, variant, settings.repeat)


def task_variant(scenario: Scenario, settings: RunSettings) -> str:
    """Return the horizon or the fault of a run, in the tasks that vary them; otherwise empty."""
    if settings.task == "horizon":
        return f"N = {settings.horizon}"
    if settings.task != "faults":
        return ""
    fault = fault_of(scenario, settings)
    return f"{settings.fault:02d}-{fault.kind if fault else 'none'}"


def fault_of(scenario: Scenario, settings: RunSettings) -> Fault | None:
    """Return the fault of a run of the task ``faults``; None: a run without one."""
    faults = (None, *faults_of(scenario))
    return faults[settings.fault] if settings.fault < len(faults) else None


def run_seed(scenario: Scenario, settings: RunSettings) -> list[int]:
    """Return the seed of the sensor noise; with 1 that of the jitter, with 2 the controller's."""
    return [scenario.seed, round(settings.duration * 1e6), settings.repeat]
