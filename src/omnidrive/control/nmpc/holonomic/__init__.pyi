from .actuation import Actuation
from .controller import HolonomicController
from .factory import holonomic_nmpc
from .ipopt import HolonomicIpopt
from .keep_out_zone import KeepOutZone, stack_keep_outs
from .law import FallbackLevel
from .limits import rate_limits, speed_limits, stack_limits
from .parameters import HolonomicParameters
from .problem import HolonomicProblem, KeepOutArrays, Limits
from .solution import HolonomicOptimizer, HolonomicSolution
from .solver import HolonomicSolver, HolonomicSolverSettings

__all__ = [
    "Actuation",
    "FallbackLevel",
    "HolonomicController",
    "HolonomicIpopt",
    "HolonomicOptimizer",
    "HolonomicParameters",
    "HolonomicProblem",
    "HolonomicSolution",
    "HolonomicSolver",
    "HolonomicSolverSettings",
    "KeepOutArrays",
    "KeepOutZone",
    "Limits",
    "holonomic_nmpc",
    "rate_limits",
    "speed_limits",
    "stack_keep_outs",
    "stack_limits",
]
