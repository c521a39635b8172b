from .common.exit import Exit
from .common.ipopt import IpoptSettings
from .unicycle import (
    PRESETS,
    UnicycleController,
    UnicycleIpopt,
    UnicycleOptimizer,
    UnicycleParameters,
    UnicycleProblem,
    UnicycleSolution,
    UnicycleSolver,
    UnicycleSolverSettings,
    tracking_problem,
    unicycle_law,
    unicycle_nmpc,
)

__all__ = [
    "PRESETS",
    "Exit",
    "IpoptSettings",
    "UnicycleController",
    "UnicycleIpopt",
    "UnicycleOptimizer",
    "UnicycleParameters",
    "UnicycleProblem",
    "UnicycleSolution",
    "UnicycleSolver",
    "UnicycleSolverSettings",
    "tracking_problem",
    "unicycle_law",
    "unicycle_nmpc",
]
