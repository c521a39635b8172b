"""Gains, membership functions and rules of PID controllers as parameters of a scenario."""

import re

import numpy as np
import pytest

import omnidrive as od
from omnidrive.components import configure, plain
from omnidrive.components.specification import parse_specification
from omnidrive.control.components import ControllerContext
from omnidrive.control.pid import gain_inference
from omnidrive.control.pid.fuzzy_options import FuzzyOptions, RuleOptions, SetOptions
from omnidrive.control.pid.options import ChannelOptions, FuzzyPidOptions, PidOptions
from omnidrive.control.pid.rules import paper_rules
from omnidrive.errors import InvalidInput
from omnidrive.estimation import State
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
from omnidrive.study import paper_scenario
from omnidrive.study.scenario_file import parse_scenario, scenario_data

PRESETS = ("paper", "published-code", "recommended")
KINDS = ("pid", "fuzzy_t1", "fuzzy_t2", "fuzzy_t3")
GOAL = Hold(Pose(0.06, -0.04, 0.2), 9.0)
GRID = np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)), axis=-1).reshape(-1, 2)


def command(kind, values, preset="paper"):
    context = ControllerContext(od.named_robot("small"), 0.1, np.random.default_rng(1), preset)
    controller = configure("controllers", kind, values).make(context)
    controller.reset(State(0.0, Pose(0.0, 0.0, 0.0)))
    twists = [
        controller.step(0.1 * k, State(0.1 * k, Pose(0.01 * k, 0.0, 0.02 * k)), GOAL).value
        for k in range(4)
    ]
    return np.array(twists)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("kind", KINDS)
def test_resolved_parameters_are_those_of_the_preset_bit_for_bit(kind, preset):
    resolved = configure("controllers", kind).resolved(preset)
    assert (command(kind, resolved.values) == command(kind, {}, preset)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_gains_act(kind):
    base, stiff = (
        command(kind, {}),
        command(kind, {"position": {"kp": 9.0}, "heading": {"kp": 1.0}}),
    )
    assert np.linalg.norm(stiff[0, :2]) > np.linalg.norm(base[0, :2])
    assert stiff[0, 2] < base[0, 2]


def test_moved_peaks_move_every_foot_at_them():
    options = FuzzyOptions(error=SetOptions(small=0.2), kd=SetOptions(medium=0.9))
    system = gain_inference("t1", "paper", options).system
    error = {each.name: each.upper.parameters for each in system.inputs[0].sets}
    assert error["PS"] == (-0.2, 0.2, 1.0)
    assert error["NS"] == (-1.0, -0.2, 0.2)
    assert error["PM"] == (0.0, 0.6667, 1.0)
    kd = {each.name: each.upper.parameters for each in system.outputs[2].sets}
    assert kd["PB"] == pytest.approx((0.09, 0.1, 0.1))
    assert kd["ZO"] == pytest.approx((-0.09, 0.0, 0.09))
    assert system.inputs[1] == gain_inference("t1", "paper").system.inputs[1]


def test_rules_replace_the_consequents_of_one_gain():
    table = tuple((3,) * 7 for _ in range(7))
    changed = gain_inference("t1", "paper", FuzzyOptions(rules=RuleOptions(kp=table)))(GRID)
    base = gain_inference("t1", "paper")(GRID)
    assert (changed[:, 0] > 0.08).all()
    assert (changed[:, 1:] == base[:, 1:]).all()


def test_footprints_act():
    base = command("fuzzy_t2", {})
    narrow = command("fuzzy_t2", {"fuzzy": {"inputs": {"lag": 0.0}, "outputs": {"lag": 0.0}}})
    assert (base != narrow).any()
    with pytest.raises(ValueError, match="inputs"):
        command("fuzzy_t1", {"fuzzy": {"inputs": {"lag": 0.0}}})


def test_scenario_files_contain_given_values_only():
    data = scenario_data(paper_scenario())
    assert data["controllers"]["fuzzy_t1"] == {"type": "fuzzy_t1", "preset": None}
    given = {"type": "fuzzy_t1", "preset": None, "position": {"kp": 9.0}}
    data["controllers"]["fuzzy_t1"] = given
    again = scenario_data(parse_scenario(data, "data"))
    assert again["controllers"]["fuzzy_t1"] == given
    assert plain(FuzzyPidOptions()) == {"preset": None}


@pytest.mark.parametrize(("preset", "name"), [("paper", "kp_deviation"), ("recommended", "tuning")])
def test_parameters_of_another_preset_are_refused(preset, name):
    data = scenario_data(paper_scenario(preset))
    data["controllers"] = {"mine": {"type": "fuzzy_t1", "heading": {name: 1.0}}}
    message = f"controllers.mine.heading.{name}: the preset {preset} has no such parameter"
    with pytest.raises(InvalidInput, match=re.escape(message)):
        parse_scenario(data, "data")
    with pytest.raises(InvalidInput, match="no such parameter"):
        PidOptions(heading=ChannelOptions(filter_time=1.0)).resolved("paper")


def test_one_rule_replaces_that_of_the_preset():
    text = "fuzzy_t1,fuzzy.rules.kp.ZO.ZO=PB,fuzzy.rules.ki.NB.PB=-2"
    _, name, values = parse_specification(text)
    made = configure("controllers", name, values)
    changes = made.parameters.fuzzy.rules.applied(paper_rules()) - paper_rules()
    assert np.argwhere(changes).tolist() == [[0, 6, 1], [3, 3, 0]]
    assert changes[0, 6, 1] == -2
    assert changes[3, 3, 0] == 3
    assert configure("controllers", name, made.values) == made  # as a scenario file states it


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ("kp=3", "must be rules such as ZO.ZO=PB .*, or 7 rows of 7 consequents; got 3"),
        ("kp.ZO=PB", "must be rules such as ZO.ZO=PB .* got 'PB'"),
        ("kp.XX.ZO=PB", "unknown set 'XX'; sets are NB, NM,"),
        ("kp.ZO.ZO=BP", "unknown set 'BP'; sets are NB, NM,"),
        ("kp.ZO.ZO=4", "unknown consequent 4; need one of NB, .* or -3 to 3"),
        ("kp.ZO.ZO=1.5", "unknown consequent 1.5"),
        ("kp.ZO.ZO=true", "unknown consequent True"),
    ],
)
def test_bad_rule_is_reported_in_words(rule, message):
    _, name, values = parse_specification(f"fuzzy_t1,fuzzy.rules.{rule}")
    with pytest.raises(ValueError, match=message) as error:
        configure("controllers", name, values)
    assert "tuple" not in str(error.value)
