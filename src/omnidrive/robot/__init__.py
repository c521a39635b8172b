"""Robot model: wheel geometry, mass properties, motor and friction limits."""

from omnidrive.robot.acceleration_polytope import acceleration_polytope
from omnidrive.robot.chassis import Chassis
from omnidrive.robot.mount import Mount, mecanum_rectangle, omni_ring
from omnidrive.robot.presets import ROBOTS, named_robot
from omnidrive.robot.robot import GRAVITY, Robot
from omnidrive.robot.robot_file import is_robot_file, load_robot, save_robot
from omnidrive.robot.wheel import OmniWheel

__all__ = [
    "GRAVITY",
    "ROBOTS",
    "Chassis",
    "Mount",
    "OmniWheel",
    "Robot",
    "acceleration_polytope",
    "is_robot_file",
    "load_robot",
    "mecanum_rectangle",
    "named_robot",
    "omni_ring",
    "save_robot",
]
