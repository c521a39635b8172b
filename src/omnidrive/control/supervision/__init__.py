"""Who watches over a controller: stops it in time, and makes up for wheels that fail."""

from omnidrive.control.supervision.remaining import Remaining
from omnidrive.control.supervision.supervisor import Adapt, Event, Seen, Supervisor
from omnidrive.control.supervision.watchdog import Watchdog, WatchdogLimits
from omnidrive.control.supervision.wheel_monitor import Finding, WheelDefect, WheelMonitor

__all__ = [
    "Adapt",
    "Event",
    "Finding",
    "Remaining",
    "Seen",
    "Supervisor",
    "Watchdog",
    "WatchdogLimits",
    "WheelDefect",
    "WheelMonitor",
]
