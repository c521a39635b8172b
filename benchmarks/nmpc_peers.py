"""The problems of the NMPC benchmark in do-mpc, timed on request.

Runs in an environment of its own. A request is ``{"peer": name, "case": name, "statement": ...,
"reset": whether the stream begins, "problems": [{"start": ..., "targets": ..., "feedforward": ...},
...]}`` (see nmpc_models.py), which it answers with the seconds and the first controls of each. The
problems of a case come in the order of the stream: every solution begins the next search.
"""

import sys
import warnings

warnings.filterwarnings("ignore")

try:
    import do_mpc
    import nmpc_models as models
    import numpy as np
    from peer_service import serve
    from timed import timed
except ImportError as error:
    sys.exit(str(error))


def do_mpc_model(s):
    model = do_mpc.model.Model("discrete", "SX")
    x = model.set_variable("_x", "state", (3, 1))
    u = model.set_variable("_u", "control", (models.controls(s), 1))
    model.set_variable("_tvp", "target", (3, 1))
    model.set_variable("_tvp", "feedforward", (models.controls(s), 1))
    if models.places(s):
        model.set_variable("_tvp", "centres", (2 * models.places(s), 1))
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
        centres = model.tvp["centres"] if models.places(s) else None
        ahead = models.Ahead(model.tvp["target"], model.tvp["feedforward"], centres)
        mpc.set_objective(
            lterm=models.stage_cost(s, x, u, ahead),
            mterm=models.terminal_cost(s, x, ahead.target, ahead.centres),
        )
        mpc.set_rterm(control=0.0)
        if models.bounds(s) is not None:
            mpc.bounds["lower", "_u", "control"] = -np.array(models.bounds(s))
            mpc.bounds["upper", "_u", "control"] = np.array(models.bounds(s))
        self._has_rates = models.has_rates(s)
        rows = models.limited(s, u, model.x["before"] if self._has_rates else 0.0 * u)
        for i in range(rows.shape[0]):
            mpc.set_nl_cons(f"forward {i}", rows[i], ub=1.0)
            mpc.set_nl_cons(f"backward {i}", -rows[i], ub=1.0)
        self._ahead, self._problem = mpc.get_tvp_template(), None
        self._parts = {"target": "targets", "feedforward": "feedforward"}
        if models.places(s):
            self._parts["centres"] = "centres"
        mpc.set_tvp_fun(self._reference)
        mpc.setup()
        self._mpc = mpc

    def _reference(self, _):
        if self._problem is None:
            return self._ahead
        for name, parts in self._parts.items():
            for k, part in enumerate(self._problem[parts]):
                self._ahead["_tvp", k, name] = part
        return self._ahead

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


made = {}


def answer(request):
    key = request["peer"], request["case"]
    if key not in made:
        made[key] = PEERS[request["peer"]](request["statement"])
    problems = [
        {name: np.array(part) for name, part in problem.items()} for problem in request["problems"]
    ]
    if request["reset"]:
        made[key].reset(problems[0])
    seconds, controls = timed(made[key], ((problem,) for problem in problems))
    return {"seconds": seconds, "controls": controls}


if __name__ == "__main__":
    serve(answer)
