"""Factory of the NMPC of holonomic robots, with its solvers by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from omnidrive.control.nmpc.holonomic.actuation import Actuation
from omnidrive.control.nmpc.holonomic.controller import HolonomicController
from omnidrive.control.nmpc.holonomic.ipopt import HolonomicIpopt
from omnidrive.control.nmpc.holonomic.keep_out_zone import (
    KeepOutForecast,
    KeepOutZone,
    forecast_keep_outs,
)
from omnidrive.control.nmpc.holonomic.parameters import HolonomicParameters
from omnidrive.control.nmpc.holonomic.solution import HolonomicOptimizer
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver, HolonomicSolverSettings
from omnidrive.control.reference_governor import ReferenceGovernor
from omnidrive.estimation.drive_estimate import DriveSettings, settings_around
from omnidrive.parameter import check_choice
from omnidrive.robot import Chassis

SolverName = Literal["sqp", "rti", "casadi"]

RTI_ITERATIONS = 4
"""With the solver ``rti``: most iterations of the active-set and of the interior-point method."""
_SOLVERS: dict[SolverName, Callable[[], HolonomicOptimizer]] = {
    "sqp": HolonomicSolver,
    "rti": lambda: HolonomicSolver(HolonomicSolverSettings(max_iterations=RTI_ITERATIONS)),
    "casadi": HolonomicIpopt,
}


def holonomic_nmpc(
    chassis: Chassis,
    dt: float,
    horizon: int = 15,
    *,
    parameters: HolonomicParameters | None = None,
    solver: SolverName | HolonomicOptimizer = "sqp",
    actuation: Actuation | None = None,
    keep_outs: KeepOutForecast | Sequence[KeepOutZone] = (),
    governor: bool = True,
    adaptation: DriveSettings | bool = True,
) -> HolonomicController:
    """Return the NMPC of a holonomic robot with limited wheel speeds, with its kernels compiled.

    Args:
        chassis: The wheels and their maximum speed.
        dt: Sample time and length of a stage, in s.
        horizon: N, number of stages.
        parameters: Weights of the cost. None: the default weights.
        solver: ``sqp``: :class:`HolonomicSolver`, an active-set and an interior-point method;
            ``rti``: the same with at most :data:`RTI_ITERATIONS` iterations of each: plans satisfy
            all limits, but are not always optimal if one is active; ``casadi``: IPOPT; or a solver
            object, for example one with a deadline.
        actuation: Acceleration limits, lag, slip and delay. None: there are none of them.
        keep_outs: Keep-out zones that are the same in every step, or a function that returns the
            zones over the horizon.
        governor: Whether the robot stays on the path of a reference that it cannot follow in time,
            and arrives later, see :class:`~omnidrive.control.ReferenceGovernor`.
        adaptation: Whether gains, lag and delay of the drive are identified and compensated;
            otherwise they are those of ``actuation``. Or the bounds of the estimates and the
            forgetting; by default the bounds contain what is known.

    Raises:
        InvalidInput: An argument is outside its domain.
        MissingExtra: ``solver`` is ``casadi``, which is not installed.
    """
    if isinstance(solver, str):
        check_choice("solver", solver, _SOLVERS)
        solver = _SOLVERS[solver]()
    actuation = actuation or Actuation()
    if isinstance(adaptation, bool):
        settings = settings_around(actuation.drive, dt) if adaptation else None
    else:
        settings = adaptation
    controller = HolonomicController(
        dt,
        horizon,
        parameters or HolonomicParameters(),
        chassis,
        actuation,
        solver,
        forecast_keep_outs(keep_outs),
        ReferenceGovernor(chassis, actuation.acceleration_faces) if governor else None,
        settings,
    )
    controller.prepare()
    return controller
