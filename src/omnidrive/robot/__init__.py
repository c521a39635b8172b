"""What the robot is: wheel geometry, mass and limits."""

from omnidrive.robot.chassis import Chassis
from omnidrive.robot.robot import GRAVITY, ROBOTS, OmniWheel, Robot, named_robot

__all__ = ["GRAVITY", "ROBOTS", "Chassis", "OmniWheel", "Robot", "named_robot"]
