"""CasADi and IPOPT as in published NMPC scripts: hand-written multiple shooting."""

from __future__ import annotations

import casadi as ca
import nmpc_models as models
import numpy as np
from nmpc_streams import AnyProblem, numbers

PAPERS_OPTIONS = {
    "ipopt": {
        "max_iter": 2000,
        "print_level": 0,
        "sb": "yes",
        "acceptable_tol": 1e-8,
        "acceptable_obj_change_tol": 1e-6,
    },
    "print_time": 0,
}
TIGHT_OPTIONS = {
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "tol": 1e-10,
        "acceptable_iter": 0,  # no early termination at the acceptable level
        "bound_relax_factor": 0.0,
    },
    "print_time": 0,
}


class Ipopt:
    """A program built once; every solution, shifted by a stage, is the next guess."""

    def __init__(self, statement: dict, options: dict) -> None:
        self._stages, self._controls = statement["stages"], models.controls(statement)
        limits = models.bounds(statement)
        limits = np.full(self._controls, np.inf) if limits is None else np.array(limits)
        free = np.full(3 * (self._stages + 1), np.inf)
        self._upper = np.concatenate([free, np.tile(limits, self._stages)])
        self._program, self._bounds = program(statement, options)
        self.reset()

    def reset(self) -> None:
        self._states = self._plan = None

    def __call__(self, problem: AnyProblem) -> np.ndarray:
        """Return the controls of the plan."""
        if self._plan is None:
            self._states = np.tile(problem.start, (self._stages + 1, 1))
            self._plan = np.zeros((self._stages, self._controls))
        else:
            self._states = np.concatenate([self._states[1:], self._states[-1:]])
            self._plan = np.concatenate([self._plan[1:], self._plan[-1:]])
        result = self._program(
            x0=np.concatenate([self._states.ravel(), self._plan.ravel()]),
            p=np.concatenate([part.ravel() for part in numbers(problem).values()]),
            lbx=-self._upper,
            ubx=self._upper,
            lbg=-self._bounds,
            ubg=self._bounds,
        )
        found = result["x"].full().ravel()
        split = 3 * (self._stages + 1)
        self._states = found[:split].reshape(-1, 3)
        self._plan = found[split:].reshape(-1, self._controls)
        return self._plan


def program(s: dict, options: dict) -> tuple[ca.Function, np.ndarray]:
    """Return the program, and the largest absolute values of its constraints."""
    stages, controls = s["stages"], models.controls(s)
    x, u = ca.SX.sym("x", 3, stages + 1), ca.SX.sym("u", controls, stages)
    start, previous = ca.SX.sym("start", 3), ca.SX.sym("previous", 3)
    targets, feedforward = ca.SX.sym("xref", 3, stages + 1), ca.SX.sym("uref", controls, stages)
    centres = ca.SX.sym("centres", 2 * models.zones(s), stages + 1)
    parts = [start, targets, feedforward]
    if s["model"] == "holonomic":
        parts += [previous, centres]
    cost = models.terminal_cost(s, x[:, stages], targets[:, stages], centres[:, stages])
    constraints, bounds = [x[:, 0] - start], [np.zeros(3)]
    before = ca.horzcat(previous[:controls], u)
    for k in range(stages):
        stage = models.StageData(targets[:, k], feedforward[:, k], centres[:, k])
        cost += models.stage_cost(s, x[:, k], u[:, k], stage)
        rows = models.limit_values(s, u[:, k], before[:, k])
        constraints += [x[:, k + 1] - models.next_state(s, x[:, k], u[:, k]), rows]
        bounds += [np.zeros(3), np.ones(rows.shape[0])]
    nlp = {
        "x": ca.vertcat(ca.vec(x), ca.vec(u)),
        "p": ca.vertcat(*map(ca.vec, parts)),
        "f": cost,
        "g": ca.vertcat(*constraints),
    }
    return ca.nlpsol("solver", "ipopt", nlp, options), np.concatenate(bounds)
