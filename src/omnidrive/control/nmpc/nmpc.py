"""The paper's non-linear model predictive controller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, isfinite, sin, sqrt
from typing import Literal

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.controller import Command, Status
from omnidrive.control.nmpc.checks import check_settings, compiled_first
from omnidrive.control.nmpc.ipopt import IpoptSolver
from omnidrive.control.nmpc.presets import PRESETS, NmpcParameters, Preset
from omnidrive.control.nmpc.problem import Problem
from omnidrive.control.nmpc.solution import Exit, Solution, Solver
from omnidrive.control.nmpc.sqp import SqpSettings, SqpSolver
from omnidrive.control.nmpc.tracking import tracking_problem
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body
from omnidrive.reference import Reference

SolverName = Literal["sqp", "rti", "casadi"]

_SOLVERS: dict[SolverName, Callable[[], Solver]] = {
    "sqp": SqpSolver,
    "rti": lambda: SqpSolver(SqpSettings(max_iterations=1)),
    "casadi": IpoptSolver,
}
_STATUS = {
    Exit.CONVERGED: Status.OK,
    Exit.CAPPED: Status.FALLBACK,
    Exit.STALLED: Status.FALLBACK,
    Exit.UNUSABLE: Status.FAILED,
}
_STOP = BodyTwist(0.0, 0.0, 0.0)


def nmpc_law(problem: Problem, solution: Solution, lateral_gain: float) -> BodyTwist:
    """Twist that drives along the first predicted heading at the first planned speed.

    "We extract third element from evolved state which acts as the target direction angle for the
    Omni-drive robot" (the paper): the velocity in W is v_0 (cos, sin)(yaw of x_1), the yaw rate
    that of u_0. The robot is omnidirectional, so it can move along a heading that it reaches only
    at the end of the step.

    That alone leaves sideways errors standing. Beside a target that is near enough, a unicycle
    with quadratic costs has its optimum in standing still (Muller & Worthmann, "Quadratic costs
    do not always work in MPC", Automatica 82, 2017): with the paper's weights and N = 15, up to
    0.5 m beside it. And a heading measured wrong by b rad is balanced by an error of about b
    metres. The robot can move sideways, so it does: at ``lateral_gain`` times the sideways error
    of x_1, as far as the speed limit leaves room.

    Args:
        problem: What was solved; its start is where the robot is.
        solution: The plan.
        lateral_gain: In 1/s; 0 is the paper's text to the letter.
    """
    speed, yaw_rate = solution.controls[0].tolist()
    x, y, direction = solution.states[1].tolist()
    c, s = cos(direction), sin(direction)
    beside = c * (float(problem.targets[1, 1]) - y) - s * (float(problem.targets[1, 0]) - x)
    room = sqrt(max(float(problem.limits[0]) ** 2 - speed**2, 0.0))
    side = min(max(lateral_gain * beside, -room), room)
    twist = WorldTwist(c * speed - s * side, s * speed + c * side, yaw_rate)
    return to_body(twist, float(problem.start[2]))


@dataclass(slots=True)
class NmpcController:
    """A :class:`~omnidrive.control.Controller` that plans anew at every step.

    Its memory is the last plan; shifted by one stage it starts the next search. A step without a
    usable plan clears it, so that one bad measurement does not spoil later steps.

    Attributes:
        dt: Sample time and length of a stage, in s.
        horizon: N, stages of the plan.
        parameters: Weights and limits.
        solver: What finds the plan.
        solution: The latest plan, for whoever wants to look; None after ``reset``.
    """

    dt: float
    horizon: int
    parameters: NmpcParameters
    solver: Solver
    solution: Solution | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        check_settings(self.dt, self.horizon, self.parameters)

    def reset(self, pose: Pose) -> None:
        """Forget the last plan."""
        self.solution = None

    def step(self, t: float, pose: Pose, reference: Reference) -> Command:
        """Command for the pose measured at ``t`` (s)."""
        problem = tracking_problem(
            self.parameters, t, pose, reference, horizon=self.horizon, dt=self.dt
        )
        if not isfinite(problem.start.sum() + problem.targets.sum() + problem.feedforward.sum()):
            self.solution = None
            return Command(_STOP, Status.FAILED)
        solution = self.solver.solve(problem, self._guess(problem))
        if solution.exit is Exit.UNUSABLE:
            self.solution = None
            return Command(_STOP, Status.FAILED)
        self.solution = solution
        twist = nmpc_law(problem, solution, self.parameters.lateral_gain)
        return Command(twist, _STATUS[solution.exit])

    def _guess(self, problem: Problem) -> Float[Array, "stages 2"]:
        """The last plan without its first stage, or the reference's own controls."""
        if self.solution is None:
            return problem.feedforward
        return np.concatenate([self.solution.controls[1:], problem.feedforward[-1:]])


def unicycle_nmpc(
    preset: Preset | NmpcParameters,
    dt: float,
    horizon: int = 15,
    solver: SolverName = "sqp",
) -> NmpcController:
    """The paper's controller.

    Args:
        preset: Weights and limits, by name or by value.
        dt: Sample time in s.
        horizon: N, stages of the plan.
        solver: ``sqp``, this package's own, converged in every step; ``rti``, the same but for one
            iteration per step (the real-time iteration of Diehl, Bock & Schloeder, SIAM J. Control
            Optim. 43(5), 2005), whose plans are seldom optimal, and say so; or ``casadi``, the
            paper's.

    Raises:
        InvalidInput: ``dt``, ``horizon`` or a name is outside its domain.
        MissingExtra: ``solver`` is ``casadi``, which is not installed.
    """
    if isinstance(preset, str) and preset not in PRESETS:
        raise InvalidInput(f"there is no preset '{preset}'; there are {', '.join(PRESETS)}")
    if solver not in _SOLVERS:
        raise InvalidInput(f"there is no solver '{solver}'; there are {', '.join(_SOLVERS)}")
    parameters = PRESETS[preset] if isinstance(preset, str) else preset
    return compiled_first(NmpcController(dt, horizon, parameters, _SOLVERS[solver]()), "_minimise")
