"""CasADi and IPOPT as a reference solver, by multiple shooting. Needs the extra ``casadi``."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc.common.exit import Exit
from omnidrive.control.nmpc.common.ipopt import IpoptSettings, casadi
from omnidrive.control.nmpc.holonomic.lqr import unconstrained_velocities
from omnidrive.control.nmpc.holonomic.motion import roll_out
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.solution import HolonomicSolution

Shape = tuple[int, int, bool, tuple[int, ...]]
"""Number of stages, number of limits, whether these are inertial, and the index of the first corner
of every keep-out zone."""


@dataclass(slots=True)
class HolonomicIpopt:
    """Direct multiple shooting: states and velocities are unknowns.

    Raises:
        MissingExtra: CasADi is not installed.
    """

    settings: IpoptSettings = field(default_factory=IpoptSettings)
    _programs: dict[Shape, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        casadi()

    def solve(
        self, problem: HolonomicProblem, guess: Float[Array, "stages 3"] | None = None
    ) -> HolonomicSolution:
        """Return the local optimum reached from ``guess``: velocities of all stages.

        None: from the optimum without limits.
        """
        if guess is None:
            guess = unconstrained_velocities(problem)
        stages, rows = len(guess), len(problem.limits.bounds)
        if not np.isfinite(guess).all():
            multipliers = np.zeros((stages, rows))
            return HolonomicSolution.of(problem, guess, multipliers, 0, Exit.UNUSABLE)
        zones = tuple(problem.keep_outs.first.tolist())
        shape = (stages, rows, bool(problem.limits.inertial), zones)
        if shape not in self._programs:
            self._programs[shape] = _program(shape, self.settings)
        program = self._programs[shape]
        bounds = np.tile(problem.limits.bounds, stages)
        defects = np.zeros(3 * (stages + 1))
        result = program(
            x0=np.concatenate([guess.ravel(), roll_out(problem, guess).ravel()]),
            p=_parameters(problem),
            lbg=np.concatenate([defects, -bounds]),
            ubg=np.concatenate([defects, bounds]),
        )
        stats = program.stats()
        velocities = np.asarray(result["x"]).ravel()[: 3 * stages].reshape(stages, 3)
        multipliers = (np.asarray(result["lam_g"]).ravel()[len(defects) :] * bounds).reshape(
            stages, rows
        )
        exit = Exit.CONVERGED if stats["success"] else Exit.CAPPED
        return HolonomicSolution.of(problem, velocities, multipliers, stats["iter_count"], exit)


def _parameters(problem: HolonomicProblem) -> np.ndarray:
    """Return the parameters of :func:`_program`, in order."""
    limits, zones = problem.limits, problem.keep_outs
    rest = (limits.now, limits.before, zones.corners, zones.radii, zones.weights, zones.centres)
    return np.concatenate([np.ravel(part) for part in (*problem[:-2], *rest)])


def _program(shape: Shape, settings: IpoptSettings) -> Any:
    """Return :class:`HolonomicProblem` as a nonlinear program with its fields as parameters."""
    ca = casadi()
    stages, rows, inertial, first = shape
    velocities, states = ca.SX.sym("v", 3, stages), ca.SX.sym("x", 3, stages + 1)
    dt, start, previous = ca.SX.sym("dt"), ca.SX.sym("start", 3), ca.SX.sym("b", 3)
    targets, feedforward = ca.SX.sym("xref", 3, stages + 1), ca.SX.sym("vref", 3, stages)
    q, r = ca.SX.sym("q", 3, stages + 1), ca.SX.sym("r", 3)
    now, before = ca.SX.sym("now", 3, rows), ca.SX.sym("before", 3, rows)
    zones = [
        (ca.SX.sym("corners", 2, b - a), ca.SX.sym("centres", 2, stages + 1))
        for a, b in pairwise(first)
    ]
    radii, weights = ca.SX.sym("radii", len(zones)), ca.SX.sym("weights", len(zones))

    twists = _stage_twists(dt, states[2, :-1], velocities)
    earlier = ca.horzcat(previous, twists[:, :-1])
    if inertial:
        rates = twists[2, :]
        turns = 0.5 * dt * (rates + ca.horzcat(0.0, rates[:-1]))
        cosines, sines = ca.cos(turns), ca.sin(turns)
        earlier = ca.vertcat(
            cosines * earlier[0, :] + sines * earlier[1, :],
            cosines * earlier[1, :] - sines * earlier[0, :],
            earlier[2, :],
        )
    limit_values = now.T @ twists - before.T @ earlier
    defects = states[:, 1:] - states[:, :-1] - dt * velocities
    cost = ca.sum1(ca.vec(q * (states - targets) ** 2)) + ca.sum1(
        ca.vec(ca.repmat(r, 1, stages) * (velocities - feedforward) ** 2)
    )
    for j, (corners, centres) in enumerate(zones):
        for k in range(stages + 1):
            distance = _signed_distance(corners, states[:2, k] - centres[:, k])
            cost += weights[j] * ca.fmax(radii[j] - distance, 0.0) ** 2
    fields = (dt, start, previous, targets, feedforward, q, r, now, before)
    rest = (*(corners for corners, _ in zones), radii, weights, *(c for _, c in zones))
    nlp = {
        "x": ca.vertcat(ca.vec(velocities), ca.vec(states)),
        "p": ca.vertcat(*map(ca.vec, (*fields, *rest))),
        "f": cost,
        "g": ca.vertcat(states[:, 0] - start, ca.vec(defects), ca.vec(limit_values)),
    }
    return ca.nlpsol("holonomic", "ipopt", nlp, settings.options())


def _stage_twists(dt: Any, yaw: Any, velocities: Any) -> Any:
    """Return the body twist of every stage."""
    ca = casadi()
    half = 0.5 * dt * velocities[2, :]
    heading = yaw + half
    # the series of h / sin(h), which is 0 / 0 without rotation
    factor = ca.if_else(ca.fabs(half) < 1e-4, 1.0 + half**2 / 6.0, half / ca.sin(half))
    ahead = ca.cos(heading) * velocities[0, :] + ca.sin(heading) * velocities[1, :]
    left = ca.cos(heading) * velocities[1, :] - ca.sin(heading) * velocities[0, :]
    return ca.vertcat(factor * ahead, factor * left, velocities[2, :])


def _signed_distance(corners: Any, position: Any) -> Any:
    """Return the signed distance from a position to a polygon, both relative to its centre."""
    ca = casadi()
    count = corners.shape[1]
    if count == 1:
        return ca.norm_2(position - corners[:, 0])
    squares, outs = [], []
    for i in range(count):
        corner, edge = corners[:, i], corners[:, (i + 1) % count] - corners[:, i]
        offset = position - corner
        along = ca.fmin(ca.fmax(ca.dot(offset, edge) / ca.sumsqr(edge), 0.0), 1.0)
        squares.append(ca.sumsqr(offset - along * edge))
        outs.append((edge[1] * offset[0] - edge[0] * offset[1]) / ca.norm_2(edge))
    nearest, outermost = ca.sqrt(ca.mmin(ca.vertcat(*squares))), ca.mmax(ca.vertcat(*outs))
    return nearest if count == 2 else ca.if_else(outermost > 0.0, nearest, outermost)
