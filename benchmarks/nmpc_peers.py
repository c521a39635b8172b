"""The problems of the NMPC benchmark in do-mpc, timed on request.

It runs in a separate environment. A request is ``{"peer": name, "case": name, "statement": ...,
"reset": whether the stream begins, "problems": [{"start": ..., "targets": ..., "feedforward": ...},
...]}`` (see nmpc_models.py); the answer has the seconds and the first controls of each. The
problems of a case arrive in the order of the stream: every solution is the guess of the next.
"""

import sys
import warnings

warnings.filterwarnings("ignore")

try:
    import do_mpc
    import nmpc_models as models
    import numpy as np
    from peer_service import serve
    from timing import time_calls
except ImportError as error:
    sys.exit(str(error))


def do_mpc_model(s):
    model = do_mpc.model.Model("discrete", "SX")
    x = model.set_variable("_x", "state", (3, 1))
    u = model.set_variable("_u", "control", (models.controls(s), 1))
    model.set_variable("_tvp", "target", (3, 1))
    model.set_variable("_tvp", "feedforward", (models.controls(s), 1))
    if models.zones(s):
        model.set_variable("_tvp", "centres", (2 * models.zones(s), 1))
    model.set_rhs("state", models.next_state(s, x, u))
    if models.has_rates(s):
        model.set_variable("_x", "before", (models.controls(s), 1))
        model.set_rhs("before", u)
    model.setup()
    return model


class DoMpc:
    def __init__(self, s):
        model = do_mpc_model(s)
        x, u = model.x["state"], model.u["control"]
        mpc = do_mpc.controller.MPC(model)
        mpc.settings.n_horizon, mpc.settings.t_step = s["stages"], s["dt"]
        mpc.settings.supress_ipopt_output()
        centres = model.tvp["centres"] if models.zones(s) else None
        stage = models.StageData(model.tvp["target"], model.tvp["feedforward"], centres)
        mpc.set_objective(
            lterm=models.stage_cost(s, x, u, stage),
            mterm=models.terminal_cost(s, x, stage.target, stage.centres),
        )
        mpc.set_rterm(control=0.0)
        if models.bounds(s) is not None:
            mpc.bounds["lower", "_u", "control"] = -np.array(models.bounds(s))
            mpc.bounds["upper", "_u", "control"] = np.array(models.bounds(s))
        self._has_rates = models.has_rates(s)
        rows = models.limit_values(s, u, model.x["before"] if self._has_rates else 0.0 * u)
        for i in range(rows.shape[0]):
            mpc.set_nl_cons(f"forward {i}", rows[i], ub=1.0)
            mpc.set_nl_cons(f"backward {i}", -rows[i], ub=1.0)
        self._template, self._problem = mpc.get_tvp_template(), None
        self._fields = {"target": "targets", "feedforward": "feedforward"}
        if models.zones(s):
            self._fields["centres"] = "centres"
        mpc.set_tvp_fun(self._reference)
        mpc.setup()
        self._mpc = mpc

    def _reference(self, _):
        if self._problem is None:
            return self._template
        for name, field in self._fields.items():
            for k, part in enumerate(self._problem[field]):
                self._template["_tvp", k, name] = part
        return self._template

    def reset(self, problem):
        self._mpc.reset_history()
        self._mpc.x0 = self._state(problem)
        self._mpc.set_initial_guess()

    def __call__(self, problem):
        self._problem = problem
        return self._mpc.make_step(self._state(problem)).ravel().tolist()

    def _state(self, problem):
        if self._has_rates:
            return np.concatenate([problem["start"], problem["previous"]])
        return problem["start"]


PEERS = {"do-mpc": DoMpc}


solvers = {}


def answer(request):
    key = request["peer"], request["case"]
    if key not in solvers:
        solvers[key] = PEERS[request["peer"]](request["statement"])
    problems = [
        {name: np.array(part) for name, part in problem.items()} for problem in request["problems"]
    ]
    if request["reset"]:
        solvers[key].reset(problems[0])
    seconds, controls = time_calls(solvers[key], ((problem,) for problem in problems))
    return {"seconds": seconds, "controls": controls}


if __name__ == "__main__":
    serve(answer)
