"""The supervisor of a scenario."""

from __future__ import annotations

from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits, WheelMonitor
from omnidrive.estimation import EncoderSettings
from omnidrive.robot import Robot
from omnidrive.study.scenario import Scenario


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
        Watchdog(limits) if section.on else None,
        WheelMonitor(robot, encoders) if scenario.wheel_monitor else None,
    )
