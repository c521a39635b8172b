"""Identification of a robot's parameters from a log of commands, wheel speeds and poses."""

from omnidrive.simulation.identification.estimate import Estimate
from omnidrive.simulation.identification.identify_lag import identify_lag
from omnidrive.simulation.identification.identify_robot import Identification, identify_robot
from omnidrive.simulation.identification.robot_log import RobotLog, read_log
from omnidrive.simulation.identification.simulated_log import (
    identification_commands,
    simulated_log,
)

__all__ = [
    "Estimate",
    "Identification",
    "RobotLog",
    "identification_commands",
    "identify_lag",
    "identify_robot",
    "read_log",
    "simulated_log",
]
