"""Parts of one run that a scenario describes: controller, sensors, estimator and supervisor."""

from __future__ import annotations

import numpy as np

from omnidrive.control import Command, Controller, Status
from omnidrive.control.components import ControllerContext
from omnidrive.control.controller import check_controller
from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits, WheelMonitor
from omnidrive.errors import ComponentFailed, InvalidInput
from omnidrive.estimation import EncoderSettings, LatestFix, State, StateEstimator
from omnidrive.estimation.components import EstimatorContext
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Reference
from omnidrive.robot import Robot
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation import PaperNoise, PerfectSensors, Sensors, SensorSuite


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


class FailedController:
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


def make_sensors(
    scenario: Scenario, robot: Robot, rng: np.random.Generator, *, noise: bool = False
) -> Sensors:
    """Return new simulated sensors; with ``noise``, the pose fixes have the paper's noise.

    If the scenario has no sensors section, the fixes are exact without ``noise``.
    """
    section = scenario.sensors
    if section is None:
        return PaperNoise(rng) if noise else PerfectSensors()
    settings = (section.with_paper_noise() if noise else section).settings
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
