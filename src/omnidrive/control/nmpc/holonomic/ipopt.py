"""The same problem for CasADi and IPOPT, to compare with. Needs the extra ``casadi``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from omnidrive.control.nmpc.holonomic.linear import unlimited
from omnidrive.control.nmpc.holonomic.motion import roll_out
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.solution import HolonomicSolution
from omnidrive.control.nmpc.ipopt import IpoptSettings, casadi
from omnidrive.control.nmpc.solution import Exit


@dataclass(slots=True)
class HolonomicIpopt:
    """Direct multiple shooting: states and velocities are unknowns.

    Raises:
        MissingExtra: CasADi is not installed.
    """

    settings: IpoptSettings = field(default_factory=IpoptSettings)
    _programs: dict[tuple[int, int], Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        casadi()

    def solve(self, problem: HolonomicProblem) -> HolonomicSolution:
        """Local optimum, reached from the optimum without limits."""
        guess = unlimited(problem)
        stages, wheels = len(guess), len(problem.limits)
        if not np.isfinite(guess).all():
            none = np.zeros((stages, wheels))
            return HolonomicSolution.of(problem, guess, none, 0, Exit.UNUSABLE)
        if (stages, wheels) not in self._programs:
            self._programs[stages, wheels] = _program(stages, wheels, self.settings)
        program = self._programs[stages, wheels]
        limits = np.tile(problem.limits, stages)
        still = np.zeros(3 * (stages + 1))
        result = program(
            x0=np.concatenate([guess.ravel(), roll_out(problem, guess).ravel()]),
            p=np.concatenate([np.ravel(part) for part in problem[:-1]]),
            lbg=np.concatenate([still, -limits]),
            ubg=np.concatenate([still, limits]),
        )
        stats = program.stats()
        velocities = np.asarray(result["x"]).ravel()[: 3 * stages].reshape(stages, 3)
        multipliers = (np.asarray(result["lam_g"]).ravel()[len(still) :] * limits).reshape(
            stages, wheels
        )
        exit = Exit.CONVERGED if stats["success"] else Exit.CAPPED
        return HolonomicSolution.of(problem, velocities, multipliers, stats["iter_count"], exit)


def _program(stages: int, wheels: int, settings: IpoptSettings) -> Any:
    """:class:`HolonomicProblem` as a nonlinear program; its parameters are the fields, in order."""
    ca = casadi()
    velocities, states = ca.SX.sym("v", 3, stages), ca.SX.sym("x", 3, stages + 1)
    dt, start = ca.SX.sym("dt"), ca.SX.sym("start", 3)
    targets, feedforward = ca.SX.sym("xref", 3, stages + 1), ca.SX.sym("vref", 3, stages)
    q, r, rows = ca.SX.sym("q", 3, stages + 1), ca.SX.sym("r", 3), ca.SX.sym("j", 3, wheels)

    half = 0.5 * dt * velocities[2, :]
    heading = states[2, :-1] + half
    # h / sin(h) is 0 / 0 at rest
    stretch = ca.if_else(ca.fabs(half) < 1e-4, 1.0 + half**2 / 6.0, half / ca.sin(half))
    ahead = ca.cos(heading) * velocities[0, :] + ca.sin(heading) * velocities[1, :]
    left = ca.cos(heading) * velocities[1, :] - ca.sin(heading) * velocities[0, :]
    twists = ca.vertcat(stretch * ahead, stretch * left, velocities[2, :])
    gaps = states[:, 1:] - states[:, :-1] - dt * velocities
    cost = ca.sum1(ca.vec(q * (states - targets) ** 2)) + ca.sum1(
        ca.vec(ca.repmat(r, 1, stages) * (velocities - feedforward) ** 2)
    )
    nlp = {
        "x": ca.vertcat(ca.vec(velocities), ca.vec(states)),
        "p": ca.vertcat(dt, start, *map(ca.vec, (targets, feedforward, q)), r, ca.vec(rows)),
        "f": cost,
        "g": ca.vertcat(states[:, 0] - start, ca.vec(gaps), ca.vec(rows.T @ twists)),
    }
    return ca.nlpsol("holonomic", "ipopt", nlp, settings.options())
