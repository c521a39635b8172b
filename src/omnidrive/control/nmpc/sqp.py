"""Sequential quadratic programming in the controls alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.newton import Point, newton_step
from omnidrive.control.nmpc.problem import Problem
from omnidrive.control.nmpc.solution import Exit, Solution
from omnidrive.control.nmpc.unicycle import (
    clip,
    cost,
    costates,
    gradient,
    kkt_residual,
    roll_out,
)
from omnidrive.parameter import Bounds

Array = np.ndarray


class SqpSettings(NamedTuple):
    """When the solver stops."""

    tolerance: Annotated[float, Bounds(1e-10, 1e-2, "1")] = 1e-7
    """KKT residual that counts as converged."""
    max_iterations: Annotated[int, Bounds(1, 1000, "1")] = 60
    """Iterations after which the best plan so far is returned."""


@dataclass(frozen=True, slots=True)
class SqpSolver:
    """Newton-type SQP with single shooting; all of it compiled.

    Each iteration takes out the controls that their limits hold, and solves the quadratic
    program in the others by a Riccati sweep (:func:`~omnidrive.control.nmpc.newton.newton_step`);
    a backtracking search along the projected step makes J fall. This is the two-metric projection
    of Bertsekas, "Projected Newton methods for optimization problems with simple constraints",
    SIAM J. Control Optim. 20(2), 1982. The Hessian is exact where it is positive definite, and
    convergence quadratic; elsewhere it is Gauss-Newton's (Bock & Plitt, IFAC 1984; Nocedal &
    Wright, 2006, section 10.3). At a saddle, such as standing still beside the target, the
    search leaves along a direction of negative curvature (More & Sorensen, "On the use of
    directions of negative curvature in a modified Newton method", Math. Program. 16, 1979).

    From one iterate to the next J does not rise beyond rounding: the last is the best known plan.
    """

    settings: SqpSettings = field(default_factory=SqpSettings)

    def solve(self, problem: Problem, guess: Float[Array, "stages 2"]) -> Solution:
        """Local optimum reached from ``guess`` (m/s, rad/s)."""
        controls, iterations, code = _minimise(problem, guess, *self.settings)
        return Solution.of(problem, controls, iterations, _EXITS[code])


_CONVERGED, _CAPPED, _STALLED = 0, 1, 2
_EXITS = (Exit.CONVERGED, Exit.CAPPED, Exit.STALLED)
_MAX_HALVINGS = 30
_ARMIJO = 1e-4
"""Share of the predicted fall that is enough (Nocedal & Wright, 2006, section 3.1)."""
_ROUNDING = 1e-11
"""Relative difference of J that may be rounding: J sums squares of small differences of states."""


@compiled
def _minimise(
    problem: Problem, guess: Float[Array, "stages 2"], tolerance: float, max_iterations: int
) -> tuple[Float[Array, "stages 2"], int, int]:
    point = _evaluate(problem, clip(problem, guess))
    for iteration in range(max_iterations):
        stationary = kkt_residual(problem, point.controls, point.gradient) <= tolerance
        definite, step = newton_step(problem, point, 1.0)
        if stationary and definite:
            return point.controls, iteration, _CONVERGED
        if stationary:
            moved, controls = _escape(problem, point, step)
        else:
            moved, controls = _advance(problem, point, step, definite)
        if not moved:
            return point.controls, iteration, _CONVERGED if stationary else _STALLED
        point = _evaluate(problem, controls)
    if kkt_residual(problem, point.controls, point.gradient) <= tolerance:
        return point.controls, max_iterations, _CONVERGED
    return point.controls, max_iterations, _CAPPED


@compiled
def _evaluate(problem: Problem, controls: Float[Array, "stages 2"]) -> Point:
    states = roll_out(problem, controls)
    adjoint = costates(problem, states, controls)
    slope = gradient(problem, states, controls, adjoint)
    free = np.ones((len(controls), 2), dtype=np.bool_)
    for k in range(len(controls)):
        for i in range(2):
            outward = slope[k, i] * controls[k, i] < 0.0
            free[k, i] = abs(controls[k, i]) < problem.limits[i] or not outward
    return Point(controls, states, adjoint, slope, free)


@compiled
def _advance(
    problem: Problem, point: Point, step: Float[Array, "stages 2"], definite: bool
) -> tuple[bool, Float[Array, "stages 2"]]:
    """Take Newton's step; where that is none, the better of Gauss-Newton's and an escape.

    Args:
        problem: What is minimised.
        point: Not stationary.
        step: From :func:`newton_step` with the exact Hessian.
        definite: As it says.

    Returns:
        Whether J fell, and the new controls.
    """
    if definite:
        moved, controls = _search(problem, point, step)
        if moved:
            return True, controls
    _, descent = newton_step(problem, point, 0.0)
    moved, controls = _search(problem, point, descent)
    if not definite:
        escaped, other = _escape(problem, point, step)
        here = cost(problem, roll_out(problem, controls), controls)
        if escaped and cost(problem, roll_out(problem, other), other) < here:
            return True, other
    return moved, controls


@compiled
def _search(
    problem: Problem, point: Point, step: Float[Array, "stages 2"]
) -> tuple[bool, Float[Array, "stages 2"]]:
    """Halve a descent step until J falls enough: Armijo's rule along the projected arc.

    Returns:
        Whether J fell, and the new controls.
    """
    start = cost(problem, point.states, point.controls)
    for halvings in range(_MAX_HALVINGS):
        controls, predicted = _moved(problem, point, 0.5**halvings, step)
        reached = cost(problem, roll_out(problem, controls), controls)
        if reached <= start * (1.0 + _ROUNDING) + _ARMIJO * predicted:
            return True, controls
    return False, point.controls


@compiled
def _moved(
    problem: Problem, point: Point, scale: float, step: Float[Array, "stages 2"]
) -> tuple[Float[Array, "stages 2"], float]:
    """Controls after a scaled step, clipped; and what that changes J by, to first order."""
    controls = clip(problem, point.controls + scale * step)
    change = 0.0
    for k in range(len(controls)):
        for i in range(2):
            change += point.gradient[k, i] * (controls[k, i] - point.controls[k, i])
    return controls, change


@compiled
def _escape(
    problem: Problem, point: Point, direction: Float[Array, "stages 2"]
) -> tuple[bool, Float[Array, "stages 2"]]:
    """Leave a saddle along a direction of negative curvature, to the side where J is lower.

    Returns:
        Whether J fell, and the new controls.
    """
    start = cost(problem, point.states, point.controls)
    for halvings in range(_MAX_HALVINGS):
        scale = 0.5**halvings
        ahead, _ = _moved(problem, point, scale, direction)
        back, _ = _moved(problem, point, -scale, direction)
        reached_ahead = cost(problem, roll_out(problem, ahead), ahead)
        reached_back = cost(problem, roll_out(problem, back), back)
        if min(reached_ahead, reached_back) < start * (1.0 - _ROUNDING):
            return True, ahead if reached_ahead <= reached_back else back
    return False, point.controls
