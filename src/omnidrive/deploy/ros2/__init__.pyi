from .simulated_robot import Ros2Robot, Ros2RobotSettings

__all__ = [
    "Ros2Robot",
    "Ros2RobotSettings",
]
