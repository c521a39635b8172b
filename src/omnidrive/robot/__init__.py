"""What the robot is: wheel geometry, mass and limits."""

from omnidrive.robot.chassis import Chassis
from omnidrive.robot.mount import Mount, mecanum_rectangle, omni_ring
from omnidrive.robot.robot import GRAVITY, ROBOTS, OmniWheel, Robot, named_robot
from omnidrive.robot.traction import traction_faces

__all__ = [
    "GRAVITY",
    "ROBOTS",
    "Chassis",
    "Mount",
    "OmniWheel",
    "Robot",
    "mecanum_rectangle",
    "named_robot",
    "omni_ring",
    "traction_faces",
]
