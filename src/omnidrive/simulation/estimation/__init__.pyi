from .estimator import PoseEstimator
from .sensor import EstimatingSensor
from .settings import EstimatorSettings

__all__ = ["EstimatingSensor", "EstimatorSettings", "PoseEstimator"]
