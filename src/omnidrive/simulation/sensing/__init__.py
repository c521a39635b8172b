"""What a robot's sensors tell of the truth, and what a controller sees."""

from omnidrive.simulation.sensing.encoders import Encoders, EncoderSettings
from omnidrive.simulation.sensing.gyro import Gyro, GyroSettings
from omnidrive.simulation.sensing.lidar import Lidar, LidarSettings, Scan
from omnidrive.simulation.sensing.pose_fix import PoseFixes, PoseFixSettings
from omnidrive.simulation.sensing.readings import Fix, Readings
from omnidrive.simulation.sensing.sensor import (
    Estimate,
    LatestFix,
    PaperNoise,
    PerfectSensor,
    Sensor,
)
from omnidrive.simulation.sensing.suite import SensorConditions, Sensors, SensorSettings

__all__ = [
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
    "SensorConditions",
    "SensorSettings",
    "Sensors",
]
