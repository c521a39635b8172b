from .encoders import Encoders, EncoderSettings
from .gyro import Gyro, GyroSettings
from .lidar import Lidar, LidarSettings, Scan
from .pose_fix import PoseFixes, PoseFixSettings
from .readings import Fix, Readings
from .sensor import (
    DisturbableSensor,
    Estimate,
    LatestFix,
    PaperNoise,
    PerfectSensor,
    Sensor,
)
from .suite import Sensors, SensorSettings

__all__ = [
    "DisturbableSensor",
    "EncoderSettings",
    "Encoders",
    "Estimate",
    "Fix",
    "Gyro",
    "GyroSettings",
    "LatestFix",
    "Lidar",
    "LidarSettings",
    "PaperNoise",
    "PerfectSensor",
    "PoseFixSettings",
    "PoseFixes",
    "Readings",
    "Scan",
    "Sensor",
    "SensorSettings",
    "Sensors",
]
