"""The supervisor that a scenario asks for."""

from __future__ import annotations

import numpy as np

from omnidrive.control import Controller, HolonomicController
from omnidrive.control.nmpc.holonomic import Actuation
from omnidrive.control.nmpc.holonomic.slip_model import SlipModel
from omnidrive.control.supervision import (
    Adapt,
    Remaining,
    Supervisor,
    Watchdog,
    WatchdogLimits,
    WheelMonitor,
)
from omnidrive.robot import Robot
from omnidrive.study.scenario import Scenario


def make_supervisor(scenario: Scenario, robot: Robot, controller: Controller) -> Supervisor:
    """A fresh supervisor of ``controller``, which is told of wheels that fail if it can use it."""
    section = scenario.watchdog
    usual = WatchdogLimits.of(robot)
    limits = WatchdogLimits(
        usual.error if section.error is None else section.error,
        section.position_sigma,
        section.age,
        section.patience,
    )
    return Supervisor(
        robot,
        Watchdog(limits) if section.on else None,
        WheelMonitor(robot) if scenario.wheel_monitor else None,
        _adapt(scenario, robot, controller),
    )


def _adapt(scenario: Scenario, robot: Robot, controller: Controller) -> Adapt | None:
    if not isinstance(controller, HolonomicController):
        return None
    section, usual = scenario.recommended, controller.actuation

    def adapt(left: Remaining) -> Controller:
        """The same plans within what the wheels that are left can do."""
        slip_model = SlipModel.of(robot, may_spin=scenario.wheels_may_spin)
        weakest = float(left.force_limits.min() / robot.max_force)
        slip_model = slip_model._replace(
            rim_jacobian=np.ascontiguousarray(left.rim_jacobian),
            max_force=weakest * slip_model.max_force,
        )
        actuation = Actuation(
            left.acceleration_faces / section.traction, robot.lag, slip_model, usual.delay
        )
        return controller.driving(left.chassis, actuation)

    return adapt
