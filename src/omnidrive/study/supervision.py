"""The supervisor of a scenario."""

from __future__ import annotations

from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits, WheelMonitor
from omnidrive.estimation import EncoderSettings
from omnidrive.robot import Robot
from omnidrive.study.scenario import Scenario


def make_supervisor(scenario: Scenario, robot: Robot) -> SafetySupervisor:
    """A new supervisor with the scenario's watchdog and wheel monitor."""
    section = scenario.watchdog
    usual = WatchdogLimits.of(robot)
    limits = WatchdogLimits(
        usual.error if section.error is None else section.error,
        section.position_sigma,
        section.age,
        section.patience,
    )
    encoders = scenario.sensors.encoders if scenario.sensors else EncoderSettings()
    return SafetySupervisor(
        robot,
        Watchdog(limits) if section.on else None,
        WheelMonitor(robot, encoders) if scenario.wheel_monitor else None,
    )
