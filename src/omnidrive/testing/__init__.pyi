from .controllers import check_controller
from .estimators import check_estimator
from .plants import check_plant

__all__ = ["check_controller", "check_estimator", "check_plant"]
