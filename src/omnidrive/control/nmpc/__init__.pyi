from .ipopt import IpoptSettings, IpoptSolver
from .nmpc import NmpcController, nmpc_law, unicycle_nmpc
from .presets import PRESETS, NmpcParameters
from .problem import Problem
from .solution import Exit, Solution, Solver
from .sqp import SqpSettings, SqpSolver
from .tracking import tracking_problem

__all__ = [
    "PRESETS",
    "Exit",
    "IpoptSettings",
    "IpoptSolver",
    "NmpcController",
    "NmpcParameters",
    "Problem",
    "Solution",
    "Solver",
    "SqpSettings",
    "SqpSolver",
    "nmpc_law",
    "tracking_problem",
    "unicycle_nmpc",
]
