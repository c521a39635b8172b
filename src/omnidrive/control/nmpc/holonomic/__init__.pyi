from .actuation import Actuation
from .controller import (
    HolonomicController,
    Rung,
    holonomic_nmpc,
)
from .grip import Grip
from .ipopt import HolonomicIpopt
from .keep_out import KeepOut, keep_outs
from .limits import joined, rate_limits, speed_limits
from .parameters import HolonomicParameters
from .problem import HolonomicProblem, KeepOuts, Limits
from .solution import HolonomicPlanner, HolonomicSolution
from .solver import HolonomicSolver, InteriorSettings

__all__ = [
    "Actuation",
    "Grip",
    "HolonomicController",
    "HolonomicIpopt",
    "HolonomicParameters",
    "HolonomicPlanner",
    "HolonomicProblem",
    "HolonomicSolution",
    "HolonomicSolver",
    "InteriorSettings",
    "KeepOut",
    "KeepOuts",
    "Limits",
    "Rung",
    "holonomic_nmpc",
    "joined",
    "keep_outs",
    "rate_limits",
    "speed_limits",
]
