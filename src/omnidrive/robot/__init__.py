"""What the robot is: wheel geometry, mass and limits."""

from omnidrive.robot.chassis import Chassis
from omnidrive.robot.robot import ROBOTS, OmniWheel, Robot, named_robot

__all__ = ["ROBOTS", "Chassis", "OmniWheel", "Robot", "named_robot"]
