"""The paper's nonlinear model predictive controller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, isfinite, sin, sqrt
from typing import Literal

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.controller import Command, CommandLimits, Status
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.control.nmpc.common.checks import check_settings
from omnidrive.control.nmpc.common.exit import Exit
from omnidrive.control.nmpc.unicycle.ipopt import UnicycleIpopt
from omnidrive.control.nmpc.unicycle.parameters import PRESETS, Preset, UnicycleParameters
from omnidrive.control.nmpc.unicycle.problem import UnicycleProblem
from omnidrive.control.nmpc.unicycle.solution import UnicycleOptimizer, UnicycleSolution
from omnidrive.control.nmpc.unicycle.solver import UnicycleSolver, UnicycleSolverSettings
from omnidrive.control.nmpc.unicycle.tracking import largest_motion, tracking_problem
from omnidrive.control.preparation import run_once
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, WorldTwist, to_body
from omnidrive.parameter import check_choice
from omnidrive.reference import Reference

SolverName = Literal["sqp", "rti", "casadi"]

_SOLVERS: dict[SolverName, Callable[[], UnicycleOptimizer]] = {
    "sqp": UnicycleSolver,
    "rti": lambda: UnicycleSolver(UnicycleSolverSettings(max_iterations=1)),
    "casadi": UnicycleIpopt,
}


def unicycle_law(
    problem: UnicycleProblem, solution: UnicycleSolution, lateral_gain: float
) -> BodyTwist:
    """Return the body twist along the first predicted heading, at the first planned speed.

    "We extract third element from evolved state which acts as the target direction angle for the
    Omni-drive robot" (the paper): the velocity in W is v_0 (cos, sin)(yaw of x_1), and the yaw
    rate is that of u_0. The robot is omnidirectional, so that it can move along a heading that it
    reaches only at the end of the step.

    This law alone leaves a lateral error. If the target is beside the robot and near enough, a
    unicycle with quadratic costs has its optimum at rest (Muller & Worthmann, "Quadratic costs
    do not always work in MPC", Automatica 82, 2017): with the paper's weights and N = 15, for
    lateral errors of up to 0.5 m. A heading that is measured wrong by b rad causes a steady error
    of about b metres. Therefore a lateral velocity is added: ``lateral_gain`` times the lateral
    error of x_1, limited so that the total speed keeps the speed limit.

    Args:
        problem: The problem solved; its start is the pose of the robot.
        solution: The plan.
        lateral_gain: In 1/s; 0 is the paper's law.
    """
    speed, yaw_rate = solution.controls[0].tolist()
    x, y, direction = solution.states[1].tolist()
    c, s = cos(direction), sin(direction)
    error = c * (float(problem.targets[1, 1]) - y) - s * (float(problem.targets[1, 0]) - x)
    max_lateral = sqrt(max(problem.limits.speed**2 - speed**2, 0.0))
    lateral = min(max(lateral_gain * error, -max_lateral), max_lateral)
    twist = WorldTwist(c * speed - s * lateral, s * speed + c * lateral, yaw_rate)
    return to_body(twist, float(problem.start[2]))


@dataclass(slots=True)
class UnicycleController(GuardedController):
    """A :class:`~omnidrive.control.Controller` that solves a :class:`UnicycleProblem` every step.

    Its only memory is the latest plan: shifted by one stage, it is the initial guess of the next
    solve. A step without a usable plan clears it.

    Attributes:
        dt: Sample time and length of a stage, in s.
        horizon: N, number of stages.
        parameters: Weights and limits.
        solver: Solver of the optimal control problem.
        solution: The latest plan; None if there is none since ``reset``.

    Raises:
        InvalidInput: ``dt``, ``horizon`` or a parameter is outside its domain.
    """

    dt: float
    horizon: int
    parameters: UnicycleParameters
    solver: UnicycleOptimizer
    solution: UnicycleSolution | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        check_settings(self.dt, self.horizon, self.parameters)

    def reset(self, state: State) -> None:
        """Clear the latest plan."""
        self.solution = None

    def prepare(self) -> None:
        """Compile the kernels of a step."""
        run_once(self)

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command for the state estimated at ``t`` (s); only its pose is used."""
        pose = state.pose
        problem = tracking_problem(
            self.parameters, t, pose, reference, horizon=self.horizon, dt=self.dt
        )
        if not isfinite(problem.start.sum() + problem.targets.sum() + problem.feedforward.sum()):
            self.solution = None
            return self.fall_back("the reference is not finite")
        solution = self.solver.solve(problem, self._guess(problem))
        if solution.exit is Exit.UNUSABLE:
            self.solution = None
            return self.fall_back("no usable solution")
        self.solution = solution
        twist = unicycle_law(problem, solution, self.parameters.lateral_gain)
        converged = solution.exit is Exit.CONVERGED
        return Command(twist, Status.OK if converged else Status.FALLBACK)

    def command_limits(self, reference: Reference) -> CommandLimits:
        """Return the largest speed and yaw rate of a plan."""
        return largest_motion(self.parameters, reference.duration, self.dt)

    def _guess(self, problem: UnicycleProblem) -> Float[Array, "stages 2"]:
        """Return the latest plan shifted by one stage; without a plan, the feedforward controls."""
        if self.solution is None:
            return problem.feedforward
        return np.concatenate([self.solution.controls[1:], problem.feedforward[-1:]])


def unicycle_nmpc(
    preset: Preset | UnicycleParameters,
    dt: float,
    horizon: int = 15,
    solver: SolverName = "sqp",
) -> UnicycleController:
    """Return the paper's controller, with its kernels compiled.

    Args:
        preset: Weights and limits, by name or by value.
        dt: Sample time in s.
        horizon: N, number of stages.
        solver: ``sqp``: :class:`UnicycleSolver`, converged in every step; ``rti``: the same solver
            with one iteration per step (the real-time iteration of Diehl, Bock & Schloeder, SIAM
            J. Control Optim. 43(5), 2005), whose plans are rarely optimal, and then have the
            status FALLBACK; ``casadi``: IPOPT, as in the paper.

    Raises:
        InvalidInput: ``dt``, ``horizon`` or a name is outside its domain.
        MissingExtra: ``solver`` is ``casadi``, which is not installed.
    """
    if not isinstance(preset, UnicycleParameters):
        check_choice("preset", preset, PRESETS)
    check_choice("solver", solver, _SOLVERS)
    parameters = preset if isinstance(preset, UnicycleParameters) else PRESETS[preset]
    controller = UnicycleController(dt, horizon, parameters, _SOLVERS[solver]())
    controller.prepare()
    return controller
