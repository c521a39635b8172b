"""Solver of unicycle problems: sequential quadratic programming with single shooting."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.common.exit import CAPPED, CONVERGED, EXITS, STALLED
from omnidrive.control.nmpc.unicycle.motion import clip, clip_controls
from omnidrive.control.nmpc.unicycle.problem import Control, UnicycleProblem
from omnidrive.control.nmpc.unicycle.riccati import newton_step
from omnidrive.control.nmpc.unicycle.solution import Assessment, UnicycleSolution, assess
from omnidrive.control.nmpc.unicycle.stage_point import (
    StagePoint,
    allocate_point,
    differentiate,
    evaluate,
    kkt_residual,
    propagate,
)
from omnidrive.parameter import Bounds

_MAX_HALVINGS = 30
_ARMIJO = 1e-4
"""Sufficient decrease, as a part of the predicted one (Nocedal & Wright, 2006, section 3.1)."""
_ROUNDING = 1e-11
"""Relative change of J that may be rounding: J sums squares of small differences of states."""


class UnicycleSolverSettings(NamedTuple):
    """Stopping criteria of :class:`UnicycleSolver`."""

    tolerance: Annotated[float, Bounds(1e-10, 1e-2, "1")] = 1e-7
    """KKT residual below which a plan counts as converged."""
    max_iterations: Annotated[int, Bounds(1, 1000, "1")] = 60
    """Number of iterations after which the latest iterate is returned."""


@dataclass(frozen=True, slots=True)
class UnicycleSolver:
    """Newton-type SQP with single shooting, compiled.

    Each iteration fixes the controls that are held by an active limit, and solves the quadratic
    program in the free ones by a Riccati sweep
    (:func:`~omnidrive.control.nmpc.unicycle.riccati.newton_step`); a backtracking line search
    along the projected step lowers J. This is the two-metric projection of Bertsekas, "Projected
    Newton methods for optimization problems with simple constraints", SIAM J. Control Optim.
    20(2), 1982. The Hessian is exact where it is positive definite, and convergence quadratic;
    elsewhere the Gauss-Newton Hessian is used (Bock & Plitt, IFAC 1984; Nocedal & Wright, 2006,
    section 10.3). At a saddle, such as rest beside the target, the search follows a direction of
    negative curvature (More & Sorensen, "On the use of directions of negative curvature in a
    modified Newton method", Math. Program. 16, 1979).

    J does not increase from one iterate to the next beyond rounding: the last is the best one.
    """

    settings: UnicycleSolverSettings = field(default_factory=UnicycleSolverSettings)

    def solve(self, problem: UnicycleProblem, guess: Float[Array, "stages 2"]) -> UnicycleSolution:
        """Return the local optimum reached from ``guess`` (m/s, rad/s); never raise."""
        p = problem
        controls, assessment, iterations, code = _solve_unicycle(
            p.dt, p.start, p.targets, p.feedforward, p.state_weights, *p.control_weights,
            *p.limits, guess, *self.settings,
        )  # fmt: skip
        return UnicycleSolution.from_assessment(controls, assessment, iterations, EXITS[code])


@compiled
def _solve_unicycle(  # noqa: PLR0917
    dt: float,
    start: Float[Array, " 3"],
    targets: Float[Array, "points 3"],
    feedforward: Float[Array, "stages 2"],
    state_weights: Float[Array, "points 3"],
    speed_weight: float,
    yaw_rate_weight: float,
    max_speed: float,
    max_yaw_rate: float,
    guess: Float[Array, "stages 2"],
    tolerance: float,
    max_iterations: int,
) -> tuple[Float[Array, "stages 2"], Assessment, int, int]:
    """Return controls, assessment, iterations and exit code.

    The fields of the problem are separate arguments because a call with a tuple takes longer.
    """
    weights, limits = Control(speed_weight, yaw_rate_weight), Control(max_speed, max_yaw_rate)
    problem = UnicycleProblem(dt, start, targets, feedforward, state_weights, weights, limits)
    controls, iterations, code = _minimise(problem, guess, tolerance, max_iterations)
    return controls, assess(problem, controls), iterations, code


@compiled
def _minimise(
    problem: UnicycleProblem,
    guess: Float[Array, "stages 2"],
    tolerance: float,
    max_iterations: int,
) -> tuple[Float[Array, "stages 2"], int, int]:
    point, value = evaluate(problem, clip_controls(problem, guess))
    trial = allocate_point(len(guess))
    for iteration in range(max_iterations + 1):
        stationary = kkt_residual(problem, point) <= tolerance
        if iteration == max_iterations:
            break
        definite, step = newton_step(problem, point, 1.0)
        if stationary and definite:
            break
        moved, reached = False, value
        if definite:
            moved, reached = _line_search(problem, point, value, step, trial)
        if not moved:
            moved, reached = _fallback_step(
                problem, point, value, step, definite, stationary, trial
            )
        if not moved:
            break
        point, trial, value = trial, point, reached
        differentiate(problem, point)
    capped = iteration == max_iterations
    code = CONVERGED if stationary else CAPPED if capped else STALLED
    return point.controls, iteration, code


@compiled
def _line_search(
    problem: UnicycleProblem,
    point: StagePoint,
    value: float,
    step: Float[Array, "stages 2"],
    trial: StagePoint,
) -> tuple[bool, float]:
    """Halve a descent step until J decreases enough: Armijo's rule along the projected arc.

    Args:
        problem: The problem.
        point: Start of the step.
        value: J at ``point``.
        step: A descent direction.
        trial: Output: end of the accepted step.

    Returns:
        Whether J decreased enough, and J at ``trial``.
    """
    moved, reached, scale = False, value, 1.0
    for _ in range(_MAX_HALVINGS):
        predicted, reached = _try_step(problem, point, scale, step, trial)
        moved = reached <= value * (1.0 + _ROUNDING) + _ARMIJO * predicted
        if moved:
            break
        scale *= 0.5
    return moved, reached


@compiled
def _try_step(
    problem: UnicycleProblem,
    point: StagePoint,
    scale: float,
    step: Float[Array, "stages 2"],
    trial: StagePoint,
) -> tuple[float, float]:
    """Take ``scale * step``, clipped; return the first-order change of J, and J at ``trial``."""
    limits, controls, gradient = problem.limits, point.controls, point.gradient
    moved = trial.controls
    change = 0.0
    for k in range(len(controls)):
        for i in range(2):
            moved[k, i] = clip(controls[k, i] + scale * step[k, i], limits[i])
            change += gradient[k, i] * (moved[k, i] - controls[k, i])
    return change, propagate(problem, trial)


@compiled
def _fallback_step(  # noqa: PLR0917
    problem: UnicycleProblem,
    point: StagePoint,
    value: float,
    step: Float[Array, "stages 2"],
    definite: bool,
    stationary: bool,
    trial: StagePoint,
) -> tuple[bool, float]:
    """Take another step where the exact Newton step does not exist or does not lower J.

    Candidates are the Gauss-Newton step, unless the point is stationary, and a step along the
    direction of negative curvature, if the Hessian is not positive definite; of two candidates
    the one with the lower J is taken.

    Args:
        problem: The problem.
        point: Start of the step.
        value: J at ``point``.
        step: From :func:`newton_step` with the exact Hessian.
        definite: From :func:`newton_step`: whether that Hessian is positive definite.
        stationary: Whether the KKT residual is below the tolerance.
        trial: Output: end of the accepted step.

    Returns:
        Whether J decreased, and J at ``trial``.
    """
    moved, reached, scale, escaped = False, value, 0.0, value
    if not definite:
        scale, escaped = _escape_saddle(problem, point, value, step, trial)
    if not stationary:
        _, descent = newton_step(problem, point, 0.0)
        moved, reached = _line_search(problem, point, value, descent, trial)
    if scale != 0.0 and not (moved and reached <= escaped):
        moved = True
        _, reached = _try_step(problem, point, scale, step, trial)
    return moved, reached


@compiled
def _escape_saddle(
    problem: UnicycleProblem,
    point: StagePoint,
    value: float,
    direction: Float[Array, "stages 2"],
    trial: StagePoint,
) -> tuple[float, float]:
    """Search along a direction of negative curvature, with both signs, for a lower J.

    The arguments are those of :func:`_line_search`; ``trial`` is a workspace.

    Returns:
        Signed length of the step, 0 if no length lowers J; and J there.
    """
    scale = 1.0
    for _ in range(_MAX_HALVINGS):
        _, forward = _try_step(problem, point, scale, direction, trial)
        _, backward = _try_step(problem, point, -scale, direction, trial)
        if min(forward, backward) < value * (1.0 - _ROUNDING):
            return (scale, forward) if forward <= backward else (-scale, backward)
        scale *= 0.5
    return 0.0, value
