"""Robots from descriptions in other formats: URDF, MJCF and parameters of ros2_control."""

from omnidrive.robot.imports.draft import ImportedRobot
from omnidrive.robot.imports.import_robot import FORMATS, import_robot

__all__ = ["FORMATS", "ImportedRobot", "import_robot"]
