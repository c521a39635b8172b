from .clock import Clock, MonotonicClock, SimulatedClock
from .controls import DriveControls
from .drive import DriveResult, drive
from .drive_state import DriveState, StateChange
from .links.lekiwi import LeKiwiLink
from .links.simulated import SimulatedLink, SimulatedProcess, SimulatedRobot
from .links.wheels import WheelsLink
from .log_replay import LogReplay, replay_log
from .robot_link import LinkCapabilities, LinkLost, RobotLink

__all__ = [
    "Clock",
    "DriveControls",
    "DriveResult",
    "DriveState",
    "LeKiwiLink",
    "LinkCapabilities",
    "LinkLost",
    "LogReplay",
    "MonotonicClock",
    "RobotLink",
    "SimulatedClock",
    "SimulatedLink",
    "SimulatedProcess",
    "SimulatedRobot",
    "StateChange",
    "WheelsLink",
    "drive",
    "replay_log",
]
