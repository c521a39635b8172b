"""Sequential quadratic programming in the controls alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.newton import newton_step
from omnidrive.control.nmpc.point import Point, blank_point
from omnidrive.control.nmpc.problem import Problem
from omnidrive.control.nmpc.solution import Exit, Solution
from omnidrive.control.nmpc.unicycle import (
    assess,
    clip,
    clipped,
    differentiate,
    drive,
    evaluate,
    kkt_residual,
)
from omnidrive.parameter import Bounds


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
        controls, assessed, iterations, code = _minimise(*problem, guess, *self.settings)
        return Solution.assessed(controls, assessed, iterations, _EXITS[code])


_CONVERGED, _CAPPED, _STALLED = 0, 1, 2
_EXITS = (Exit.CONVERGED, Exit.CAPPED, Exit.STALLED)
_MAX_HALVINGS = 30
_ARMIJO = 1e-4
"""Share of the predicted fall that is enough (Nocedal & Wright, 2006, section 3.1)."""
_ROUNDING = 1e-11
"""Relative difference of J that may be rounding: J sums squares of small differences of states."""


@compiled
def _minimise(  # noqa: PLR0917
    dt: float,
    start: Float[Array, " 3"],
    targets: Float[Array, "points 3"],
    feedforward: Float[Array, "stages 2"],
    state_weights: Float[Array, "points 3"],
    control_weights: Float[Array, " 2"],
    limits: Float[Array, " 2"],
    guess: Float[Array, "stages 2"],
    tolerance: float,
    max_iterations: int,
) -> tuple[Float[Array, "stages 2"], tuple[Float[Array, "points 3"], float, float], int, int]:
    """Controls, what they lead to, iterations and exit; a problem's fields are quicker to take."""
    problem = Problem(dt, start, targets, feedforward, state_weights, control_weights, limits)
    controls, iterations, code = _descend(problem, guess, tolerance, max_iterations)
    return controls, assess(problem, controls), iterations, code


@inlined
def _descend(
    problem: Problem, guess: Float[Array, "stages 2"], tolerance: float, max_iterations: int
) -> tuple[Float[Array, "stages 2"], int, int]:
    point, value = evaluate(problem, clip(problem, guess))
    trial = blank_point(len(guess))
    for iteration in range(max_iterations + 1):
        stationary = kkt_residual(problem, point) <= tolerance
        if iteration == max_iterations:
            break
        definite, step = newton_step(problem, point, 1.0)
        if stationary and definite:
            break
        moved, reached = False, value
        if definite:
            moved, reached = _search(problem, point, value, step, trial)
        if not moved:
            moved, reached = _detour(problem, point, value, step, definite, stationary, trial)
        if not moved:
            break
        point, trial, value = trial, point, reached
        differentiate(problem, point)
    capped = iteration == max_iterations
    code = _CONVERGED if stationary else _CAPPED if capped else _STALLED
    return point.controls, iteration, code


@inlined
def _search(
    problem: Problem, point: Point, value: float, step: Float[Array, "stages 2"], trial: Point
) -> tuple[bool, float]:
    """Halve a descent step until J falls enough: Armijo's rule along the projected arc.

    Args:
        problem: What is minimised.
        point: Where the step begins.
        value: J there.
        step: A descent direction.
        trial: Filled in: where it ends.

    Returns:
        Whether J fell, and J there.
    """
    moved, reached, scale = False, value, 1.0
    for _ in range(_MAX_HALVINGS):
        predicted, reached = _try(problem, point, scale, step, trial)
        moved = reached <= value * (1.0 + _ROUNDING) + _ARMIJO * predicted
        if moved:
            break
        scale *= 0.5
    return moved, reached


@inlined
def _try(
    problem: Problem, point: Point, scale: float, step: Float[Array, "stages 2"], trial: Point
) -> tuple[float, float]:
    """Drive a scaled step, clipped; what that changes J by, to first order, and J there."""
    limits, controls, slope, moved = problem.limits, point.controls, point.gradient, trial.controls
    change = 0.0
    for k in range(len(controls)):
        for i in range(2):
            moved[k, i] = clipped(controls[k, i] + scale * step[k, i], limits[i])
            change += slope[k, i] * (moved[k, i] - controls[k, i])
    return change, drive(problem, trial)


@compiled
def _detour(  # noqa: PLR0917
    problem: Problem,
    point: Point,
    value: float,
    step: Float[Array, "stages 2"],
    definite: bool,
    stationary: bool,
    trial: Point,
) -> tuple[bool, float]:
    """Go on where Newton's step is none, or leads nowhere.

    By Gauss-Newton's step, unless the point is stationary; and by an escape, if the Hessian is
    not positive definite; by the better of the two, where there are two.

    Args:
        problem: What is minimised.
        point: Where to begin.
        value: J there.
        step: From :func:`newton_step` with the exact Hessian.
        definite: As it says.
        stationary: Whether the KKT residual is below the tolerance.
        trial: Filled in: where it ends.

    Returns:
        Whether J fell, and J there.
    """
    moved, reached, side, below = False, value, 0.0, value
    if not definite:
        side, below = _escape(problem, point, value, step, trial)
    if not stationary:
        _, descent = newton_step(problem, point, 0.0)
        moved, reached = _search(problem, point, value, descent, trial)
    if side != 0.0 and not (moved and reached <= below):
        moved = True
        _, reached = _try(problem, point, side, step, trial)
    return moved, reached


@inlined
def _escape(
    problem: Problem, point: Point, value: float, direction: Float[Array, "stages 2"], trial: Point
) -> tuple[float, float]:
    """Leave a saddle along a direction of negative curvature, to the side where J is lower.

    The arguments are those of :func:`_search`; ``trial`` is only used.

    Returns:
        How far to go, with sign, 0 if J falls nowhere; and J there.
    """
    scale = 1.0
    for _ in range(_MAX_HALVINGS):
        _, ahead = _try(problem, point, scale, direction, trial)
        _, back = _try(problem, point, -scale, direction, trial)
        if min(ahead, back) < value * (1.0 - _ROUNDING):
            return (scale, ahead) if ahead <= back else (-scale, back)
        scale *= 0.5
    return 0.0, value
