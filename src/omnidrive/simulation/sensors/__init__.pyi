from .encoders import Encoders
from .gyro import Gyro
from .lidar import Lidar, LidarSettings, Scan
from .pose_fix import PoseFixes
from .sensors import PaperNoise, PerfectSensors, Sensors
from .suite import SensorSuite

__all__ = [
    "Encoders",
    "Gyro",
    "Lidar",
    "LidarSettings",
    "PaperNoise",
    "PerfectSensors",
    "PoseFixes",
    "Scan",
    "SensorSuite",
    "Sensors",
]
