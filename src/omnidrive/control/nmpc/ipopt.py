"""The paper's solver: CasADi and IPOPT, by multiple shooting. Needs the extra ``casadi``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from types import ModuleType
from typing import Annotated, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.nmpc import unicycle
from omnidrive.control.nmpc.problem import Problem
from omnidrive.control.nmpc.solution import Exit, Solution
from omnidrive.errors import MissingExtra
from omnidrive.parameter import Bounds


class IpoptSettings(NamedTuple):
    """When the solver stops."""

    tolerance: Annotated[float, Bounds(1e-12, 1e-2, "1")] = 1e-9
    """IPOPT's ``tol``."""
    max_iterations: Annotated[int, Bounds(1, 3000, "1")] = 200
    """IPOPT's ``max_iter``."""

    def options(self) -> dict[str, object]:
        """What CasADi is told: these, and to be quiet."""
        return {
            "print_time": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.tol": self.tolerance,
            "ipopt.max_iter": self.max_iterations,
        }


@dataclass(slots=True)
class IpoptSolver:
    """Direct multiple shooting (Bock & Plitt, IFAC 1984): states and controls are unknowns.

    The nonlinear program is built once per number of stages (Andersson et al., "CasADi", Math.
    Program. Comput. 11, 2019; Wachter & Biegler, "IPOPT", Math. Program. 106, 2006).

    Raises:
        MissingExtra: CasADi is not installed.
    """

    settings: IpoptSettings = field(default_factory=IpoptSettings)
    _programs: dict[int, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        casadi()

    def solve(self, problem: Problem, guess: Float[Array, "stages 2"]) -> Solution:
        """Local optimum near ``guess`` (m/s, rad/s); if IPOPT fails, the better of the two."""
        stages = len(guess)
        if stages not in self._programs:
            self._programs[stages] = _program(stages, self.settings)
        guess = unicycle.clip(problem, guess)
        free = np.full((stages + 1, 3), np.inf)
        program = self._programs[stages]
        result = program(
            x0=_pack(guess, unicycle.roll_out(problem, guess)),
            p=np.concatenate([np.ravel(part) for part in problem[:-1]]),
            lbx=_pack(np.tile(-problem.limits, (stages, 1)), -free),
            ubx=_pack(np.tile(problem.limits, (stages, 1)), free),
            lbg=0.0,
            ubg=0.0,
        )
        stats = program.stats()
        found = np.asarray(result["x"]).ravel()[: 2 * stages].reshape(stages, 2)
        exit = Exit.CONVERGED if stats["success"] else Exit.CAPPED
        plan = Solution.of(problem, unicycle.clip(problem, found), stats["iter_count"], exit)
        start = Solution.of(problem, guess, stats["iter_count"], Exit.CAPPED)
        return plan if stats["success"] or plan.cost <= start.cost else start


def casadi() -> ModuleType:
    """The library.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return import_module("casadi")
    except ImportError as error:
        raise MissingExtra(
            "solver 'casadi' needs CasADi, which is not installed: "
            "pip install 'omnidrive[casadi]', or choose solver 'sqp'"
        ) from error


def _pack(
    controls: Float[Array, "stages 2"], states: Float[Array, "points 3"]
) -> Float[Array, " unknowns"]:
    return np.concatenate([controls.ravel(), states.ravel()])


def _program(stages: int, settings: IpoptSettings) -> Callable[..., Any]:
    """:class:`Problem` as a nonlinear program; its parameters are the fields, in order."""
    ca = casadi()
    controls, states = ca.SX.sym("u", 2, stages), ca.SX.sym("x", 3, stages + 1)
    dt, start = ca.SX.sym("dt"), ca.SX.sym("start", 3)
    targets, feedforward = ca.SX.sym("xref", 3, stages + 1), ca.SX.sym("uref", 2, stages)
    q, r = ca.SX.sym("q", 3, stages + 1), ca.SX.sym("r", 2)

    speed, yaw = controls[0, :], states[2, :-1]
    motion = ca.vertcat(speed * ca.cos(yaw), speed * ca.sin(yaw), controls[1, :])
    gaps = states[:, 1:] - states[:, :-1] - dt * motion
    cost = ca.sum1(ca.vec(q * (states - targets) ** 2)) + ca.sum1(
        ca.vec(ca.repmat(r, 1, stages) * (controls - feedforward) ** 2)
    )
    nlp = {
        "x": ca.vertcat(ca.vec(controls), ca.vec(states)),
        "p": ca.vertcat(dt, start, *map(ca.vec, (targets, feedforward, q)), r),
        "f": cost,
        "g": ca.vertcat(states[:, 0] - start, ca.vec(gaps)),
    }
    program: Callable[..., Any] = ca.nlpsol("nmpc", "ipopt", nlp, settings.options())
    return program
