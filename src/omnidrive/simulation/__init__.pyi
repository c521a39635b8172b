from .conditions import Conditions, Motor, Patch, Payload
from .estimation import EstimatingSensor, EstimatorSettings, PoseEstimator
from .identify import identify_lag
from .kinematic import KinematicPlant
from .loop import Outcome, Run, simulate
from .mujoco_plant import MujocoPlant
from .plant import DisturbablePlant, Measurement, Plant
from .sensing import (
    DisturbableSensor,
    EncoderSettings,
    Estimate,
    Fix,
    GyroSettings,
    LatestFix,
    Lidar,
    LidarSettings,
    PaperNoise,
    PerfectSensor,
    PoseFixSettings,
    Readings,
    Sensor,
    SensorConditions,
    Sensors,
    SensorSettings,
)

__all__ = [
    "Conditions",
    "DisturbablePlant",
    "DisturbableSensor",
    "EncoderSettings",
    "Estimate",
    "EstimatingSensor",
    "EstimatorSettings",
    "Fix",
    "GyroSettings",
    "KinematicPlant",
    "LatestFix",
    "Lidar",
    "LidarSettings",
    "Measurement",
    "Motor",
    "MujocoPlant",
    "Outcome",
    "PaperNoise",
    "Patch",
    "Payload",
    "PerfectSensor",
    "Plant",
    "PoseEstimator",
    "PoseFixSettings",
    "Readings",
    "Run",
    "Sensor",
    "SensorConditions",
    "SensorSettings",
    "Sensors",
    "identify_lag",
    "simulate",
]
