"""Supervision of a robot: watchdog, wheel monitor, reaction to failed wheels."""

from omnidrive.control.supervision.safety_supervisor import SafetySupervisor
from omnidrive.control.supervision.supervisor import Event, NullSupervisor, Supervisor
from omnidrive.control.supervision.watchdog import Watchdog, WatchdogLimits
from omnidrive.control.supervision.wheel_evidence import WheelDefect
from omnidrive.control.supervision.wheel_monitor import Finding, WheelMonitor

__all__ = [
    "Event",
    "Finding",
    "NullSupervisor",
    "SafetySupervisor",
    "Supervisor",
    "Watchdog",
    "WatchdogLimits",
    "WheelDefect",
    "WheelMonitor",
]
