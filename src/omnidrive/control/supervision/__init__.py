"""Who watches over a controller: stops it in time, and makes up for wheels that fail."""

from omnidrive.control.supervision.event import Event, Seen
from omnidrive.control.supervision.remaining import Remaining
from omnidrive.control.supervision.supervisor import Adapt, Supervisor
from omnidrive.control.supervision.unsupervised import Unsupervised
from omnidrive.control.supervision.watchdog import Watchdog, WatchdogLimits
from omnidrive.control.supervision.wheel_monitor import Finding, WheelDefect, WheelMonitor

__all__ = [
    "Adapt",
    "Event",
    "Finding",
    "Remaining",
    "Seen",
    "Supervisor",
    "Unsupervised",
    "Watchdog",
    "WatchdogLimits",
    "WheelDefect",
    "WheelMonitor",
]
