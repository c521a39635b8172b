"""NMPC of robots that move in any direction, within what their wheels can do."""

from omnidrive.control.nmpc.holonomic.actuation import Actuation
from omnidrive.control.nmpc.holonomic.controller import (
    HolonomicController,
    HolonomicParameters,
    Rung,
    holonomic_nmpc,
)
from omnidrive.control.nmpc.holonomic.grip import Grip
from omnidrive.control.nmpc.holonomic.ipopt import HolonomicIpopt
from omnidrive.control.nmpc.holonomic.keep_out import KeepOut, keep_outs
from omnidrive.control.nmpc.holonomic.limits import joined, rate_limits, speed_limits
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem, KeepOuts, Limits
from omnidrive.control.nmpc.holonomic.solution import HolonomicPlanner, HolonomicSolution
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver, InteriorSettings

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
