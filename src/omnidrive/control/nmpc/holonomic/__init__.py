"""NMPC of robots that move in any direction, within what their wheels can do."""

from omnidrive.control.nmpc.holonomic.controller import (
    HolonomicController,
    HolonomicParameters,
    Rung,
    holonomic_nmpc,
)
from omnidrive.control.nmpc.holonomic.ipopt import HolonomicIpopt
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.solution import HolonomicPlanner, HolonomicSolution
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver, InteriorSettings

__all__ = [
    "HolonomicController",
    "HolonomicIpopt",
    "HolonomicParameters",
    "HolonomicPlanner",
    "HolonomicProblem",
    "HolonomicSolution",
    "HolonomicSolver",
    "InteriorSettings",
    "Rung",
    "holonomic_nmpc",
]
