"""The search with synthetic runs: both optimisers, limits, repeatability."""

import numpy as np
import pytest

from omnidrive.components import configure
from omnidrive.errors import InvalidInput
from omnidrive.tuning import Budget, parameter_space, parse_limit, parse_objective, search
from omnidrive.tuning.optimizers import Score, front, knee
from tests.tuning.synthetic import lqr, record


def bowl(controllers):
    """Runs whose error is least, 1 mm, at the weight 9, gains (4, 0.5), 5 steps."""
    runs = []
    for each in controllers:
        p = each.parameters
        distance = (
            np.log(p.weights.position / 9.0) ** 2 + np.log(p.gains[0] / 4.0) ** 2
            + np.log(max(p.gains[1], 1e-9) / 0.5) ** 2 + 0.2 * (p.steps - 5) ** 2
            + p.weights.offset**2
        )  # fmt: skip
        effort = p.weights.position * p.gains[0]
        errors = [1e-3 * (1.0 + distance) * scale for scale in (0.9, 1.1)]
        runs.append([record(me=me, wheel_acceleration=effort, max_error=2.0 * me) for me in errors])
    return runs


def tuned(text, trials=300, seed=1, limits=(), evaluate=bowl):
    space = parameter_space(lqr(), "paper", choose=["!limit"])
    objectives = [parse_objective(each) for each in text.split(";")]
    found = [parse_limit(each) for each in limits]
    return search(space, objectives, found, evaluate, Budget(trials), seed)


def test_one_objective_reaches_the_minimum():
    found = tuned("me")
    assert found.trials[0].values["weights.position"] == 1.0
    assert found.trials[0].score.objectives[0] > 5.0
    assert found.best.score.objectives[0] < 1.02  # mm
    assert found.best.values["steps"] == 5
    assert found.best.values["weights.position"] == pytest.approx(9.0, rel=0.1)


def test_equal_seeds_have_equal_trials():
    first, second, other = tuned("me", 60), tuned("me", 60), tuned("me", 60, seed=2)
    assert first == second
    assert first.trials != other.trials


def test_values_have_four_digits():
    for trial in tuned("me", 40).trials:
        for value in trial.values.values():
            assert float(f"{value:.4g}") == value


def test_hard_limits_hold():
    """Without the limit the product would be 36."""
    found = tuned("me", limits=["wheel_acceleration <= 10rad/s^2"])
    assert found.best.score.violation == 0.0
    assert 8.0 < found.best.values["weights.position"] * found.best.values["gains.0"] <= 10.0


def test_refused_values_and_failed_runs_are_worst():
    def sometimes(controllers):
        """Many steps are better, but more than three fail."""
        steps = [each.parameters.steps for each in controllers]
        return [[record(finished=n <= 3, me=0.01 / n)] for n in steps]

    found = tuned("me", 60, evaluate=sometimes)
    assert found.best.values["steps"] == 3
    assert any(each.failed for each in found.trials)
    space = parameter_space(lqr(), "paper", choose=["gains.0"], ranges={"gains.0": (0.5, 9.5)})
    best = search(
        space,
        [parse_objective("me")],
        [],
        lambda controllers: [[record(me=0.1 / c.parameters.gains[0])] for c in controllers],
        Budget(80),
        1,
    ).best
    assert 8.0 < best.values["gains.0"] <= 9.0  # more is refused by the class of the parameters


def test_several_objectives_have_a_front():
    found = tuned("me;effort", 240)
    scores = [each.score for each in found.trials]
    values = np.array([scores[i].objectives for i in front(scores)])
    assert len(values) > 10
    assert (np.diff(values[:, 0]) > 0.0).all()
    assert (np.diff(values[:, 1]) < 0.0).all()
    assert values[0, 0] < 2.0
    assert found.best.score.objectives in {tuple(row) for row in values.tolist()}
    assert found == tuned("me;effort", 240)


def test_front_and_knee_by_hand():
    points = [(1.0, 9.0), (2.0, 2.0), (9.0, 1.0), (3.0, 3.0), (2.0, 2.0)]
    scores = [Score(each, 0.0) for each in points] + [Score((0.0, 0.0), 1.0)]
    assert front(scores) == [0, 1, 2]
    assert knee(scores) == 1
    assert knee(scores[-1:]) is None


def test_budget_of_time_ends_the_search():
    space = parameter_space(lqr(), "paper")
    found = search(space, [parse_objective("me")], [], bowl, Budget(10_000, 0.05), 1)
    assert 1 <= len(found.trials) < 10_000
    for budget in (Budget(1), Budget(10, -1.0), Budget(10, float("nan")), Budget(10**9)):
        with pytest.raises(InvalidInput):
            budget.check()


def test_exhausted_space_ends_the_search():
    space = parameter_space(lqr(), "paper", choose=["steps"])
    found = search(space, [parse_objective("me")], [], bowl, Budget(10_000), 1)
    assert found.best.values == {"steps": 5}
    assert len(found.trials) <= 6


def test_rules_are_searched_too():
    """147 consequents of a fuzzy PID: the sum of those of kp shall be as large as possible."""

    def evaluate(controllers):
        tables = [np.array(c.parameters.fuzzy.rules.kp) for c in controllers]
        return [[record(me=1e-3 * (1.0 + 3.0 * 49 - table.sum()))] for table in tables]

    space = parameter_space(configure("controllers", "fuzzy_t1"), "paper", choose=["*.rules.*"])
    found = search(space, [parse_objective("me")], [], evaluate, Budget(60), 1)
    assert found.best.score.objectives[0] < 0.9 * found.trials[0].score.objectives[0]
