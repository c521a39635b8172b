from .estimator_settings import EstimatorSettings
from .motion.motion_memory import ObservedMotion
from .pose_filter.pose_estimator import PoseEstimator
from .readings import PoseFix, SensorReadings
from .sensor_settings import EncoderSettings, GyroSettings, PoseFixSettings, SensorSettings
from .state import State
from .state_estimator import LatestFix, StateEstimator

__all__ = [
    "EncoderSettings",
    "EstimatorSettings",
    "GyroSettings",
    "LatestFix",
    "ObservedMotion",
    "PoseEstimator",
    "PoseFix",
    "PoseFixSettings",
    "SensorReadings",
    "SensorSettings",
    "State",
    "StateEstimator",
]
