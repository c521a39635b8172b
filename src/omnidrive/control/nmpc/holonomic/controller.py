"""The controller around a holonomic plan."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from math import isfinite
from typing import Literal

import numpy as np

from omnidrive.control.controller import Command, Status
from omnidrive.control.nmpc.checks import check_settings, compiled_first
from omnidrive.control.nmpc.holonomic.actuation import Actuation
from omnidrive.control.nmpc.holonomic.ipopt import HolonomicIpopt
from omnidrive.control.nmpc.holonomic.keep_out import KeepOut, keep_outs
from omnidrive.control.nmpc.holonomic.parameters import HolonomicParameters
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem, Limits
from omnidrive.control.nmpc.holonomic.solution import HolonomicPlanner, HolonomicSolution
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver, InteriorSettings
from omnidrive.control.nmpc.solution import Exit
from omnidrive.control.nmpc.tracking import nearest_branch
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move, twist_between
from omnidrive.reference import Hold, Reference
from omnidrive.robot import Chassis

SolverName = Literal["sqp", "rti", "casadi"]
KeepOutsAhead = Callable[[float, int, float], Sequence[KeepOut]]
"""``keep_outs(t, points, dt)``: where to stay out of at the times t, t + dt, ... (s)."""

REAL_TIME = 4
"""Iterations of each of its methods in a step with the solver ``rti``."""
_SOLVERS: dict[SolverName, Callable[[], HolonomicPlanner]] = {
    "sqp": HolonomicSolver,
    "rti": lambda: HolonomicSolver(InteriorSettings(max_iterations=REAL_TIME)),
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


@dataclass(slots=True)
class HolonomicController:
    """A :class:`~omnidrive.control.Controller` that plans anew at every step.

    The target of every stage is the reference's pose at its end, and its velocity what leads there
    from the one before: a robot on the reference stays on it. The twist of a stage is that which
    leads along an arc to the next planned state; what is asked for is it and, against lag or the
    slip of wheels, as much more as it changes. Against the delay, a plan begins where the twists
    asked for before lead until it acts.

    No step begins from the last one's plan, so a bad measurement spoils no later step. Where there
    is no plan, the old one goes on for a few steps, and then the robot comes to rest: the rungs of
    :class:`Rung`, one of the details of a command.

    Attributes:
        dt: Sample time and length of a stage, in s.
        horizon: N, stages of the plan.
        parameters: Weights.
        chassis: The wheels, and how fast they can turn.
        actuation: How the robot follows.
        solver: What finds the plan.
        keep_outs: Where to stay out of.
        solution: The latest plan; None after ``reset``.
    """

    dt: float
    horizon: int
    parameters: HolonomicParameters
    chassis: Chassis
    actuation: Actuation
    solver: HolonomicPlanner
    keep_outs: KeepOutsAhead
    solution: HolonomicSolution | None = field(default=None, init=False)
    _age: int = field(default=0, init=False)
    _twists: deque[BodyTwist] = field(init=False, repr=False)
    """What the robot does, by the model: from the first that will still act, to the last asked."""
    _moving: BodyTwist = field(init=False, repr=False)
    """How it moves when that begins to act; only with a grip."""
    _limits: Limits = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_settings(self.dt, self.horizon, self.parameters)
        self._limits = self.actuation.limits(self.chassis, self.dt)
        self._twists = deque(maxlen=int(self.actuation.delay / self.dt) + 1)
        self._forget()

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Names and units of the details of a command."""
        return {"rung": "1", "solver_iterations": "1", "kkt_residual": "1"}

    def reset(self, pose: Pose) -> None:
        """Forget the last plan; the robot is at rest."""
        self._forget()

    def driving(self, chassis: Chassis, actuation: Actuation) -> HolonomicController:
        """The controller that goes on from here with other wheels, but the same delay.

        Args:
            chassis: The wheels, and how fast they can turn.
            actuation: How the robot follows from now on.
        """
        other = replace(self, chassis=chassis, actuation=actuation)
        other.solution, other._age, other._moving = self.solution, self._age, self._moving
        other._twists.extend(self._twists)
        return other

    def _forget(self) -> None:
        self.solution, self._age, self._moving = None, 0, _STOP
        self._twists.extend([_STOP] * (self._twists.maxlen or 0))

    def step(self, t: float, pose: Pose, reference: Reference) -> Command:
        """Command for the pose measured at ``t`` (s)."""
        problem = self._problem(t + self.actuation.delay, self._after_delay(pose), reference)
        usable = isfinite(problem.start.sum() + problem.targets.sum())
        solution = self.solver.solve(problem) if usable else None
        if solution is None or solution.exit is Exit.UNUSABLE:
            return self._without_plan()
        self.solution, self._age = solution, 0
        rung = Rung.CONVERGED if solution.exit is Exit.CONVERGED else Rung.FEASIBLE
        status = Status.OK if rung is Rung.CONVERGED else Status.FALLBACK
        return Command(self._ask(self._twist(solution, 0)), status, self._details(rung, solution))

    def _after_delay(self, pose: Pose) -> Pose:
        """Where the twists asked for before lead until the next one acts."""
        if self.actuation.delay > 0.0:
            first, *others = self._twists
            pose = move(pose, first, self.actuation.delay - len(others) * self.dt)
            for twist in others:
                pose = move(pose, twist, self.dt)
        return pose

    def _without_plan(self) -> Command:
        self._age += 1
        plan, age = self.solution, self._age
        if plan is None or age > FOLLOWED + RAMP or age >= len(plan.velocities):
            self._twists.append(_STOP)
            self._moving = _STOP
            return Command(_STOP, Status.FAILED, self._details(Rung.STOP, None))
        part = min(1.0, (FOLLOWED + RAMP - age + 1) / (RAMP + 1))
        vx, vy, yaw_rate = self._twist(plan, age)
        twist = self._ask(BodyTwist(part * vx, part * vy, part * yaw_rate))
        rung = Rung.OLD_PLAN if part == 1.0 else Rung.RAMP
        return Command(twist, Status.FALLBACK, self._details(rung, None))

    def _twist(self, plan: HolonomicSolution, stage: int) -> BodyTwist:
        here, there = plan.states[stage : stage + 2].tolist()
        return twist_between(Pose(*here), Pose(*there), self.dt)

    def _ask(self, twist: BodyTwist) -> BodyTwist:
        """What to ask for so that the robot does this next."""
        before = self._twists[-1]
        self._twists.append(twist)
        if self.actuation.grip is not None:
            asked, self._moving = self.actuation.grip.ask(twist, self._moving, self.dt)
            return self.chassis.saturate(asked)  # which may allow less than the robot
        moving, turning = (lag / self.dt for lag in self.actuation.lag)
        return BodyTwist(
            twist.vx + moving * (twist.vx - before.vx),
            twist.vy + moving * (twist.vy - before.vy),
            twist.yaw_rate + turning * (twist.yaw_rate - before.yaw_rate),
        )

    def _details(self, rung: Rung, plan: HolonomicSolution | None) -> tuple[float, float, float]:
        if plan is None:
            return float(rung), 0.0, np.nan
        return float(rung), float(plan.iterations), plan.residual

    def _problem(self, t: float, pose: Pose, reference: Reference) -> HolonomicProblem:
        points = self.horizon + 1
        targets = reference.window(t, points, self.dt)[:, :3].copy()
        with np.errstate(invalid="ignore"):  # what is not finite is caught by the caller
            targets[:, 2] = nearest_branch(targets[:, 2], pose.yaw)
            feedforward = np.diff(targets, axis=0) / self.dt
        return HolonomicProblem(
            dt=float(self.dt),
            start=np.array(pose, dtype=float),
            previous=np.array(self._twists[-1]),
            targets=targets,
            feedforward=feedforward,
            state_weights=self.parameters.state_weights(points, self.dt),
            control_weights=self.parameters.control_weights(),
            limits=self._limits,
            keep_outs=keep_outs(self.keep_outs(t, points, self.dt), points),
        )


def holonomic_nmpc(
    chassis: Chassis,
    dt: float,
    horizon: int = 15,
    *,
    parameters: HolonomicParameters | None = None,
    solver: SolverName | HolonomicPlanner = "sqp",
    actuation: Actuation | None = None,
    keep_outs: KeepOutsAhead | Sequence[KeepOut] = (),
) -> HolonomicController:
    """NMPC of a holonomic robot within what its wheels can do.

    Args:
        chassis: The wheels, and how fast they can turn.
        dt: Sample time in s.
        horizon: N, stages of the plan.
        parameters: Weights.
        solver: ``sqp``, this package's own; ``rti``, the same with few iterations: within all
            limits, but not always optimal where one binds; ``casadi``, which is IPOPT; or one with
            settings of its own, such as a deadline.
        actuation: Limits of acceleration, lag and delay; the default has none of them.
        keep_outs: Places that stay where they are, or what tells for every step where they will be.

    Raises:
        InvalidInput: An argument is outside its domain.
        MissingExtra: ``solver`` is ``casadi``, which is not installed.
    """
    if isinstance(solver, str):
        if solver not in _SOLVERS:
            raise InvalidInput(f"there is no solver '{solver}'; there are {', '.join(_SOLVERS)}")
        solver = _SOLVERS[solver]()
    controller = HolonomicController(
        dt,
        horizon,
        parameters or HolonomicParameters(),
        chassis,
        actuation or Actuation(),
        solver,
        keep_outs if callable(keep_outs) else _still(keep_outs),
    )
    compiled_first(controller, "_solve")
    if isinstance(solver, HolonomicSolver) and solver.deadline is not None:
        solver.load(controller._problem(0.0, Pose(0.0, 0.0, 0.0), Hold(Pose(0.0, 0.0, 0.0), 1.0)))
    return controller


def _still(places: Sequence[KeepOut]) -> KeepOutsAhead:
    return lambda t, points, dt: places
