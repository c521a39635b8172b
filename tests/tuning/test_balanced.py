"""The default objective: relative, over kinds of motions, and no part may become worse."""

from dataclasses import replace
from math import exp, inf, log, nan

import pytest

from omnidrive.errors import InvalidInput
from omnidrive.tuning import (
    Budget,
    Gain,
    Tuning,
    TuningSettings,
    held_out_gain,
    load_tuning,
    parameter_space,
    search,
    tune,
)
from omnidrive.tuning.balanced import BalancedObjective, objective_of
from omnidrive.tuning.report import _harm
from omnidrive.tuning.search import score_of
from omnidrive.tuning.task_metrics import compared_value, metric_value
from tests.tuning.synthetic import lqr, record
from tests.tuning.test_tune import scenario

AXES = ("motion",)


def tracking(number, motion, *, me=0.02, mae=0.01, repetition=0, **metrics):
    made = record(number, repetition=repetition, me=me, mae=mae, **metrics)
    return replace(made, factors={"motion": motion})


def step(number, *, settling=1.0, overshoot=10.8, motion="step", repetition=0):
    metrics = {f"settling_time_{axis}": settling for axis in ("x", "heading")}
    metrics |= {"overshoot_x": 0.0, "overshoot_heading": overshoot}
    metrics |= {"overshoot_y": nan, "settling_time_y": nan, "rise_time_y": nan}
    made = record(number, repetition=repetition, **metrics)
    return replace(made, task="step", duration=10.0, factors={"motion": motion})


def runs(me=0.02, square=0.03, **changes):
    return [tracking(0, "circle", me=me), tracking(1, "square", me=square), step(2, **changes)]


BASE = runs()
OBJECTIVE = BalancedObjective().relative_to(BASE, AXES)


def test_value_is_the_geometric_mean_over_motions_and_their_parts():
    assert OBJECTIVE.value(BASE) == pytest.approx(1.0)
    found = OBJECTIVE.value(runs(me=0.01, square=0.015, settling=0.5, overshoot=0.0))
    circle, square = (0.5 * log((0.5 * me + 5e-5) / (me + 5e-5)) for me in (0.02, 0.03))
    steps = 0.25 * (2.0 * log(0.55 / 1.05) + log(1.0 / 1.108))
    assert found == pytest.approx(exp((circle + square + steps) / 3.0))


def test_value_has_no_unit():
    before, after = runs(me=20.0, square=30.0), runs(me=10.0, square=45.0)
    large = BalancedObjective().relative_to(before, AXES).value(after)
    small = OBJECTIVE.value(runs(me=0.01, square=0.045))
    assert large == pytest.approx(small, rel=1e-3)


@pytest.mark.parametrize(
    "worse",
    [
        runs(me=0.005, overshoot=34.5),  # the step pays for ME
        runs(me=0.005, settling=1.1),
        runs(me=0.005, settling=nan),  # it does not settle any more
        runs(me=0.005, square=0.0417),  # another reference pays, by 39 %
    ],
)
def test_gain_that_a_step_or_another_reference_pays_for_is_worse_than_no_gain(worse):
    kept, lost = (score_of(each, [OBJECTIVE], []) for each in (BASE, worse))
    assert kept.violation == 0.0
    assert lost.order > kept.order
    gain = score_of(runs(me=0.015), [OBJECTIVE], [])
    assert gain.order < kept.order


@pytest.mark.parametrize(("objective", "accepted"), [("balanced", False), ("me", True)])
def test_search_accepts_no_trade_of_a_step_for_me_by_default(objective, accepted):
    def evaluate(controllers):
        """Return runs whose ME falls with a weight by which the step overshoots."""
        found = []
        for each in controllers:
            gain = max(each.parameters.weights.position, 1.0)
            found.append(runs(me=0.02 / gain, overshoot=10.8 * gain))
        return found

    space = parameter_space(lqr(), "paper", choose=("weights.position",))
    result = search(space, [objective_of(objective)], [], evaluate, Budget(20), 1, axes=AXES)
    assert min(each.values["weights.position"] for each in result.trials) < 1.0
    assert (result.best.values["weights.position"] > 1.1) is accepted


def test_runs_that_ended_early():
    crashed = [replace(BASE[0], finished=False), *BASE[1:]]
    objective = BalancedObjective().relative_to(crashed, AXES)
    assert objective.value(BASE) == pytest.approx(1.0)
    assert score_of(BASE, [objective], []).order < score_of(crashed, [objective], []).order
    assert BalancedObjective().value(BASE) == inf  # relative to nothing


def test_settling_time_is_that_of_the_slowest_axis_with_a_step():
    assert metric_value(step(0, settling=1.5), "settling_time") == 1.5
    never = step(0, settling=nan)
    assert metric_value(never, "settling_time") != metric_value(never, "settling_time")
    assert [compared_value(never, f"settling_time{each}") for each in ("", "_x")] == [10.0, 10.0]
    assert compared_value(never, "settling_time_y") != compared_value(never, "settling_time_y")


def test_balanced_is_a_name_and_no_metric():
    assert objective_of(" balanced ") == BalancedObjective()
    with pytest.raises(InvalidInput, match="is an objective of its own"):
        objective_of("balanced + me")
    with pytest.raises(InvalidInput, match="did you mean 'balanced'"):
        objective_of("balancd")


def held_out(scale):
    """Return runs of seven references and a step, in six repetitions, with ME times a factor."""
    found = []
    for repetition in range(6):
        for k in range(7):
            number = 8 * repetition + k
            factor = scale[k] * (1.0 + 0.01 * repetition)
            found.append(tracking(number, f"r{k}", me=0.02 * factor, repetition=repetition))
        overshoot = 10.0 * scale[7] + 0.1 * repetition
        found.append(step(8 * repetition + 7, overshoot=overshoot, repetition=repetition))
    return found


def test_report_marks_what_is_worse_as_a_whole_and_on_each_motion():
    before = held_out([1.0] * 8)
    after = held_out([0.5, 0.6, 0.5, 1.39, 0.6, 0.5, 0.5, 3.0])
    found = held_out_gain(before, after, [BalancedObjective()], AXES)
    assert [each.motion for each in found.motions] == [*(f"r{k}" for k in range(7)), "step"]
    worse = {(motion, gain.label) for motion, gain in found.worse}
    assert ("r3", "ME, mm") in worse
    assert ("step", "overshoot heading, %") in worse
    assert ("", "overshoot heading, %") in worse
    assert ("r0", "ME, mm") not in worse
    assert found.gain("balanced").before == 1.0
    (sentence,) = _harm(found)
    assert sentence.startswith("Worse after tuning: overshoot heading, %")
    assert "ME, mm (+39.0 %) in r3" in sentence
    same = held_out_gain(before, before, [BalancedObjective()], AXES)
    assert same.worse == ()
    assert _harm(same) == []


def test_interval_is_over_references_and_repetitions():
    before, even = held_out([1.0] * 8), held_out([0.8] * 7 + [1.0])
    alike = held_out_gain(before, even, [objective_of("me")], AXES).gains[0]
    assert alike.verdict == "better"
    mixed = held_out([0.3, 0.5, 1.2, 0.7, 1.1, 0.8, 1.0, 1.0])  # the mean is the same
    other = held_out_gain(before, mixed, [objective_of("me")], AXES)
    gain = other.gains[0]
    assert gain.difference.mean == pytest.approx(alike.difference.mean)
    assert gain.difference.margin > 5.0 * alike.difference.margin
    assert {each.gains[0].verdict for each in other.motions[:2]} == {"better"}


def test_direction_and_zero_before():
    before = [tracking(0, "circle", min_clearance=0.2, collisions=0.0)]
    after = [tracking(0, "circle", min_clearance=0.1, collisions=1.0)]
    found = held_out_gain(before, after, [objective_of("me")], AXES)
    worse = {gain.label: gain.change for motion, gain in found.worse if not motion}
    assert worse == {"min. clearance, mm": "−50.0 %", "collisions": "from 0 to 1"}
    assert isinstance(found.gains[0], Gain)


def test_default_tuning_gains_on_other_motions_and_resumes(tmp_path):
    settings = TuningSettings(
        controller="slow", trials=16, parameters=("position.kp", "heading.kp")
    )
    result = tune(Tuning.of(scenario(), settings), tmp_path)
    assert [each.text for each in result.tuning.objectives] == ["balanced"]
    assert result.search.trials[0].score.objectives == pytest.approx((1.0,))
    assert result.chosen.score.violation == 0.0
    gain = result.held_out.gain("balanced")
    assert gain.verdict == "better"
    assert len(result.held_out.motions) == 9
    steps = [each for each in result.held_out.motions if each.motion.startswith("step")]
    for each in steps:
        found = {gain.label: gain for gain in each.gains}
        for axis in ("x", "y", "heading"):
            overshoot = found[f"overshoot {axis}, %"]
            assert overshoot.after < overshoot.before + 4.0
    again = tune(load_tuning(tmp_path), tmp_path)
    assert (again.search, again.chosen, again.held_out) == (
        result.search, result.chosen, result.held_out,
    )  # fmt: skip
