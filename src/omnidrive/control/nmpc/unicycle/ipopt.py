"""The paper's solver: CasADi and IPOPT, by multiple shooting. Needs the extra ``casadi``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc.common.exit import Exit
from omnidrive.control.nmpc.common.ipopt import IpoptSettings, casadi
from omnidrive.control.nmpc.unicycle.motion import clip_controls, roll_out
from omnidrive.control.nmpc.unicycle.problem import UnicycleProblem
from omnidrive.control.nmpc.unicycle.solution import UnicycleSolution


@dataclass(slots=True)
class UnicycleIpopt:
    """Direct multiple shooting (Bock & Plitt, IFAC 1984): states and controls are unknowns.

    The nonlinear program is built once for each number of stages, and kept (Andersson et al.,
    "CasADi", Math. Program. Comput. 11, 2019; Wachter & Biegler, "IPOPT", Math. Program. 106,
    2006).

    Raises:
        MissingExtra: CasADi is not installed.
    """

    settings: IpoptSettings = field(default_factory=IpoptSettings)
    _programs: dict[int, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        casadi()

    def solve(self, problem: UnicycleProblem, guess: Float[Array, "stages 2"]) -> UnicycleSolution:
        """Return a local optimum near ``guess`` (speed in m/s, yaw rate in rad/s).

        If IPOPT fails for any reason, the result is the controls of its last iterate or ``guess``,
        whichever has the lower cost within the limits; its exit is ``CAPPED``, or ``UNUSABLE`` if
        the cost is not finite.
        """
        stages = len(guess)
        if stages not in self._programs:
            self._programs[stages] = _program(stages, self.settings)
        guess = clip_controls(problem, guess)
        unbounded = np.full((stages + 1, 3), np.inf)
        parameters = problem._asdict()
        limits = np.tile(parameters.pop("limits"), (stages, 1))
        program = self._programs[stages]
        result = program(
            x0=_pack(guess, roll_out(problem, guess)),
            p=np.concatenate([np.ravel(part) for part in parameters.values()]),
            lbx=_pack(-limits, -unbounded),
            ubx=_pack(limits, unbounded),
            lbg=0.0,
            ubg=0.0,
        )
        stats = program.stats()
        found = np.asarray(result["x"]).ravel()[: 2 * stages].reshape(stages, 2)
        exit = Exit.CONVERGED if stats["success"] else Exit.CAPPED
        controls, iterations = clip_controls(problem, found), stats["iter_count"]
        plan = UnicycleSolution.of(problem, controls, iterations, exit)
        guessed = UnicycleSolution.of(problem, guess, iterations, Exit.CAPPED)
        return plan if stats["success"] or plan.cost <= guessed.cost else guessed


def _pack(
    controls: Float[Array, "stages 2"], states: Float[Array, "points 3"]
) -> Float[Array, " unknowns"]:
    """Return the unknowns of the program: the controls of all stages, then all states."""
    return np.concatenate([controls.ravel(), states.ravel()])


def _program(stages: int, settings: IpoptSettings) -> Callable[..., Any]:
    """Return :class:`UnicycleProblem` as a nonlinear program.

    Its parameters are all fields but ``limits``, in their order; the limits are bounds on the
    unknowns, which :func:`_pack` orders.
    """
    ca = casadi()
    controls, states = ca.SX.sym("u", 2, stages), ca.SX.sym("x", 3, stages + 1)
    dt, start = ca.SX.sym("dt"), ca.SX.sym("start", 3)
    targets, feedforward = ca.SX.sym("xref", 3, stages + 1), ca.SX.sym("uref", 2, stages)
    q, r = ca.SX.sym("q", 3, stages + 1), ca.SX.sym("r", 2)

    speed, yaw = controls[0, :], states[2, :-1]
    derivative = ca.vertcat(speed * ca.cos(yaw), speed * ca.sin(yaw), controls[1, :])
    defects = states[:, 1:] - states[:, :-1] - dt * derivative
    cost = ca.sum1(ca.vec(q * (states - targets) ** 2)) + ca.sum1(
        ca.vec(ca.repmat(r, 1, stages) * (controls - feedforward) ** 2)
    )
    nlp = {
        "x": ca.vertcat(ca.vec(controls), ca.vec(states)),
        "p": ca.vertcat(dt, start, *map(ca.vec, (targets, feedforward, q)), r),
        "f": cost,
        "g": ca.vertcat(states[:, 0] - start, ca.vec(defects)),
    }
    program: Callable[..., Any] = ca.nlpsol("nmpc", "ipopt", nlp, settings.options())
    return program
