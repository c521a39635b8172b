"""The controller around a holonomic plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from math import isfinite
from typing import Annotated, Literal, NamedTuple

import numpy as np

from omnidrive.control.controller import Command, Status
from omnidrive.control.nmpc.checks import check_settings
from omnidrive.control.nmpc.holonomic.ipopt import HolonomicIpopt
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.solution import HolonomicPlanner, HolonomicSolution
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver
from omnidrive.control.nmpc.solution import Exit
from omnidrive.control.nmpc.tracking import nearest_branch
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, twist_between
from omnidrive.parameter import Bounds
from omnidrive.reference import Reference
from omnidrive.robot import Chassis

SolverName = Literal["sqp", "casadi"]

_SOLVERS: dict[SolverName, Callable[[], HolonomicPlanner]] = {
    "sqp": HolonomicSolver,
    "casadi": HolonomicIpopt,
}
_STOP = BodyTwist(0.0, 0.0, 0.0)

FOLLOWED, RAMP = 3, 5
"""Steps for which an old plan is followed, and then those in which the robot comes to rest."""


class Rung(IntEnum):
    """What a command rests on, from the best to the last resort."""

    CONVERGED = 0
    FEASIBLE = 1
    """A plan that keeps the wheels' limits, but is not known to be optimal."""
    OLD_PLAN = 2
    """The plan of an earlier step, as if it had come true."""
    RAMP = 3
    """That plan, ever slower."""
    STOP = 4


class HolonomicParameters(NamedTuple):
    """What the controller minimises."""

    position_weight: Annotated[float, Bounds(0.0, 1e6, "1/m^2")] = 40.0
    """First two diagonal entries of Q."""
    heading_weight: Annotated[float, Bounds(0.0, 1e6, "1/rad^2")] = 40.0
    """Third diagonal entry of Q."""
    velocity_weight: Annotated[float, Bounds(1e-3, 1e4, "s^2/m^2")] = 1.0
    """First two diagonal entries of R."""
    yaw_rate_weight: Annotated[float, Bounds(1e-3, 1e4, "s^2/rad^2")] = 1.0
    """Third diagonal entry of R."""


@dataclass(slots=True)
class HolonomicController:
    """A :class:`~omnidrive.control.Controller` that plans anew at every step.

    The target of every stage is the reference's pose at its end, and its velocity what leads there
    from the one before: a robot on the reference stays on it. The command is the body twist that
    leads along an arc to the first planned state.

    No step begins from the last one's plan, so a bad measurement spoils no later step. Where there
    is no plan, the old one goes on for a few steps, and then the robot comes to rest: the rungs of
    :class:`Rung`, one of the details of a command.

    Attributes:
        dt: Sample time and length of a stage, in s.
        horizon: N, stages of the plan.
        parameters: Weights.
        chassis: The wheels, and how fast they can turn.
        solver: What finds the plan.
        solution: The latest plan; None after ``reset``.
    """

    dt: float
    horizon: int
    parameters: HolonomicParameters
    chassis: Chassis
    solver: HolonomicPlanner
    solution: HolonomicSolution | None = field(default=None, init=False)
    _age: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        check_settings(self.dt, self.horizon, self.parameters)
        if not self.chassis.max_wheel_speed > 0.0:
            raise InvalidInput(
                f"the wheels must be able to turn, got {self.chassis.max_wheel_speed:g} rad/s"
            )

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Names and units of the details of a command."""
        return {"rung": "1", "solver_iterations": "1", "kkt_residual": "1"}

    def reset(self, pose: Pose) -> None:
        """Forget the last plan."""
        self.solution = None
        self._age = 0

    def step(self, t: float, pose: Pose, reference: Reference) -> Command:
        """Command for the pose measured at ``t`` (s)."""
        problem = self._problem(t, pose, reference)
        usable = isfinite(problem.start.sum() + problem.targets.sum())
        solution = self.solver.solve(problem) if usable else None
        if solution is None or solution.exit is Exit.UNUSABLE or solution.violation > 1e-3:
            return self._without_plan()
        self.solution, self._age = solution, 0
        rung = Rung.CONVERGED if solution.exit is Exit.CONVERGED else Rung.FEASIBLE
        status = Status.OK if rung is Rung.CONVERGED else Status.FALLBACK
        return Command(self._twist(solution, 0), status, self._details(rung, solution))

    def _without_plan(self) -> Command:
        self._age += 1
        plan, age = self.solution, self._age
        if plan is None or age > FOLLOWED + RAMP or age >= len(plan.velocities):
            return Command(_STOP, Status.FAILED, self._details(Rung.STOP, None))
        part = min(1.0, (FOLLOWED + RAMP - age + 1) / (RAMP + 1))
        vx, vy, yaw_rate = self._twist(plan, age)
        twist = BodyTwist(part * vx, part * vy, part * yaw_rate)
        rung = Rung.OLD_PLAN if part == 1.0 else Rung.RAMP
        return Command(twist, Status.FALLBACK, self._details(rung, None))

    def _twist(self, plan: HolonomicSolution, stage: int) -> BodyTwist:
        here, there = plan.states[stage : stage + 2].tolist()
        return twist_between(Pose(*here), Pose(*there), self.dt)

    def _details(self, rung: Rung, plan: HolonomicSolution | None) -> tuple[float, float, float]:
        if plan is None:
            return float(rung), 0.0, np.nan
        return float(rung), float(plan.iterations), plan.residual

    def _problem(self, t: float, pose: Pose, reference: Reference) -> HolonomicProblem:
        p, chassis = self.parameters, self.chassis
        targets = reference.window(t, self.horizon + 1, self.dt)[:, :3].copy()
        with np.errstate(invalid="ignore"):  # what is not finite is caught by the caller
            targets[:, 2] = nearest_branch(targets[:, 2], pose.yaw)
            feedforward = np.diff(targets, axis=0) / self.dt
        return HolonomicProblem(
            dt=float(self.dt),
            start=np.array(pose, dtype=float),
            targets=targets,
            feedforward=feedforward,
            state_weights=np.tile(
                [p.position_weight, p.position_weight, p.heading_weight], (self.horizon + 1, 1)
            ),
            control_weights=np.array([p.velocity_weight, p.velocity_weight, p.yaw_rate_weight]),
            wheels=np.ascontiguousarray(chassis.jacobian, dtype=float),
            limits=np.full(len(chassis.jacobian), float(chassis.max_wheel_speed)),
        )


def holonomic_nmpc(
    chassis: Chassis,
    dt: float,
    horizon: int = 15,
    parameters: HolonomicParameters | None = None,
    solver: SolverName = "sqp",
) -> HolonomicController:
    """NMPC of a holonomic robot within what its wheels can do.

    Args:
        chassis: The wheels, and how fast they can turn.
        dt: Sample time in s.
        horizon: N, stages of the plan.
        parameters: Weights.
        solver: ``sqp``, this package's own, or ``casadi``, which is IPOPT.

    Raises:
        InvalidInput: An argument is outside its domain.
        MissingExtra: ``solver`` is ``casadi``, which is not installed.
    """
    if solver not in _SOLVERS:
        raise InvalidInput(f"there is no solver '{solver}'; there are {', '.join(_SOLVERS)}")
    return HolonomicController(
        dt, horizon, parameters or HolonomicParameters(), chassis, _SOLVERS[solver]()
    )
