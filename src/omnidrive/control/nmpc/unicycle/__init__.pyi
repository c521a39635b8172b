from .controller import UnicycleController, unicycle_law, unicycle_nmpc
from .ipopt import UnicycleIpopt
from .parameters import PRESETS, UnicycleParameters, robot_limits
from .problem import UnicycleProblem
from .solution import UnicycleOptimizer, UnicycleSolution
from .solver import UnicycleSolver, UnicycleSolverSettings
from .tracking import tracking_problem

__all__ = [
    "PRESETS",
    "UnicycleController",
    "UnicycleIpopt",
    "UnicycleOptimizer",
    "UnicycleParameters",
    "UnicycleProblem",
    "UnicycleSolution",
    "UnicycleSolver",
    "UnicycleSolverSettings",
    "robot_limits",
    "tracking_problem",
    "unicycle_law",
    "unicycle_nmpc",
]
