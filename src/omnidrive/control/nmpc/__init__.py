"""Nonlinear model predictive control: a problem, solvers for it, and the controller around them."""

from omnidrive.control.nmpc.ipopt import IpoptSettings, IpoptSolver
from omnidrive.control.nmpc.nmpc import NmpcController, nmpc_law, unicycle_nmpc
from omnidrive.control.nmpc.presets import PRESETS, NmpcParameters
from omnidrive.control.nmpc.problem import Problem
from omnidrive.control.nmpc.solution import Exit, Solution, Solver
from omnidrive.control.nmpc.sqp import SqpSettings, SqpSolver
from omnidrive.control.nmpc.tracking import tracking_problem

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
