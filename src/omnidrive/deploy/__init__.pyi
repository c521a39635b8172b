from .clock import Clock, MonotonicClock, SimulatedClock
from .controls import DriveControls
from .drive import DriveResult, drive
from .drive_state import DriveState, StateChange
from .links.simulated import SimulatedLink, SimulatedProcess, SimulatedRobot
from .robot_link import LinkCapabilities, LinkLost, RobotLink

__all__ = [
    "Clock",
    "DriveControls",
    "DriveResult",
    "DriveState",
    "LinkCapabilities",
    "LinkLost",
    "MonotonicClock",
    "RobotLink",
    "SimulatedClock",
    "SimulatedLink",
    "SimulatedProcess",
    "SimulatedRobot",
    "StateChange",
    "drive",
]
