from .conditions import Conditions, Motor, Patch, Payload, SensorConditions
from .coppeliasim import CoppeliaSimPlant, CoppeliaSimScene
from .estimation import EstimatingSensor, EstimatorSettings, PoseEstimator
from .faults import (
    FAULTS,
    Fault,
    Schedule,
    default_faults,
    parse_fault,
)
from .identify import identify_lag
from .kinematic import KinematicPlant
from .loop import simulate
from .moving_obstacle import MovingObstacle
from .mujoco_plant import MujocoPlant
from .planar import PlanarPlant, roll_out
from .plant import DisturbablePlant, Measurement, Plant
from .run import Outcome, Run
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
    Sensors,
    SensorSettings,
)

__all__ = [
    "FAULTS",
    "Conditions",
    "CoppeliaSimPlant",
    "CoppeliaSimScene",
    "DisturbablePlant",
    "DisturbableSensor",
    "EncoderSettings",
    "Estimate",
    "EstimatingSensor",
    "EstimatorSettings",
    "Fault",
    "Fix",
    "GyroSettings",
    "KinematicPlant",
    "LatestFix",
    "Lidar",
    "LidarSettings",
    "Measurement",
    "Motor",
    "MovingObstacle",
    "MujocoPlant",
    "Outcome",
    "PaperNoise",
    "Patch",
    "Payload",
    "PerfectSensor",
    "PlanarPlant",
    "Plant",
    "PoseEstimator",
    "PoseFixSettings",
    "Readings",
    "Run",
    "Schedule",
    "Sensor",
    "SensorConditions",
    "SensorSettings",
    "Sensors",
    "default_faults",
    "identify_lag",
    "parse_fault",
    "roll_out",
    "simulate",
]
