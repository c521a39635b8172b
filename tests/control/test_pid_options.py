"""Gains, membership functions and rules of PID controllers as parameters of a scenario."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

import omnidrive as od
from omnidrive.components import configure, plain
from omnidrive.components.specification import parse_specification
from omnidrive.control.components import ControllerContext
from omnidrive.control.pid import gain_inference
from omnidrive.control.pid.fuzzy_options import FuzzyOptions, RuleOptions, SetOptions
from omnidrive.control.pid.laws import MAX_GAIN_CHANGE
from omnidrive.control.pid.options import ChannelOptions, FuzzyPidOptions, PidOptions
from omnidrive.control.pid.rules import paper_rules
from omnidrive.control.pid.system_file import SystemFile
from omnidrive.errors import InvalidFuzzyFile, InvalidInput, InvalidScenario
from omnidrive.estimation import State
from omnidrive.fuzzy import LinearFunction, Membership, OutputVariable, save
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
from omnidrive.scenario import load_scenario, paper_scenario, save_scenario
from omnidrive.scenario.controller_file import load_controller, save_controller
from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
from omnidrive.study.setup_facts import controller_types

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


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Write the systems of the paper: t1.fis and t2.fis."""
    monkeypatch.chdir(tmp_path)
    for kind in ("t1", "t2"):
        save(gain_inference(kind, "paper").system, f"{kind}.fis")
    return tmp_path


@pytest.mark.parametrize("preset", ["paper", "recommended"])
@pytest.mark.parametrize(
    ("kind", "file"),
    [("t1", "t1.fis"), ("t2", "t1.fis"), ("t3", "t1.fis"), ("t2", "t2.fis"), ("t3", "t2.fis")],
)
def test_system_in_a_file_gives_the_commands_of_the_same_system(kind, file, preset, files):
    system = gain_inference(kind, "paper", FuzzyOptions(file="t1.fis")).system
    assert system.type == int(kind[1])
    found = command(f"fuzzy_{kind}", {"fuzzy": {"file": file}}, preset)
    assert (found == command(f"fuzzy_{kind}", {}, preset)).all()
    other = {"rules": {"kp": [[3] * 7] * 7}}
    assert (found != command(f"fuzzy_{kind}", {"fuzzy": other}, preset)).any()


def test_compiled_law_has_the_system_in_the_file(files):
    rules = FuzzyOptions(rules=RuleOptions(kp=((3,) * 7,) * 7))
    save(gain_inference("t1", "paper", rules).system, "other.fis")
    context = ControllerContext(od.named_robot("small"), 0.1, np.random.default_rng(1), "paper")
    tuners = [
        configure("controllers", "fuzzy_t1", values).make(context).compiled_law().data.position.tune
        for values in ({"fuzzy": {"file": "other.fis"}}, {"fuzzy": plain(rules)}, {})
    ]
    assert (tuners[0].floats == tuners[1].floats).all()
    assert (tuners[0].integers == tuners[1].integers).all()
    assert tuners[0].integers.tolist() != tuners[2].integers.tolist()


PAPER = gain_inference("t1", "paper").system
WIDE = tuple(replace(each, low=-3.0, high=3.0) for each in PAPER.inputs)
STRONG = tuple(replace(each, high=0.2) for each in PAPER.outputs)


def of_functions(constant, coefficients, low=-0.1, high=0.1, defuzzifier="wtaver"):
    return tuple(
        OutputVariable(
            v.name,
            low,
            high,
            tuple(LinearFunction(s.name, constant, coefficients) for s in v.sets),
            defuzzifier=defuzzifier,
        )
        for v in PAPER.outputs
    )


FUNCTIONS = of_functions(0.0, (0.2, 0.0))
SUM = of_functions(0.1, (), defuzzifier="wtsum")
ONE = tuple(replace(r, consequents=r.consequents[:1]) for r in PAPER.rules)


@pytest.mark.parametrize(
    ("system", "says"),
    [
        (replace(PAPER, inputs=WIDE), "the input 'error' has the range [-3, 3], need [-1, 1]"),
        (replace(PAPER, outputs=STRONG), "the output 'kp' has values from -0.1 to 0.2, need"),
        (replace(PAPER, outputs=FUNCTIONS), "the output 'kp' has values from -0.2 to 0.2, need"),
        (
            replace(PAPER, outputs=SUM),
            "the output 'kp' is a weighted sum (wtsum), which has no bound if several",
        ),
        (
            replace(PAPER, outputs=of_functions(0.1, (), low=0.0, high=1.0)),
            "the output 'kp' is 0.5, the middle of its range [0, 1], where no rule fires; need",
        ),
        (replace(PAPER, outputs=PAPER.outputs[::-1]), "outputs are kd, ki, kp, need the order kp"),
        (gain_inference("t2", "paper").system, "the system in the file is of type 2; use fuzzy_t2"),
        (
            replace(PAPER, outputs=PAPER.outputs[:1], rules=ONE),
            "3 outputs, the changes of kp, ki and kd; this one has 2 inputs (error, derror) and 1",
        ),
    ],
)
def test_unsuitable_system_in_a_file_is_refused(system, says, files):
    save(system, "bad.fis")
    data = scenario_data(paper_scenario())
    data["controllers"] = {"mine": {"type": "fuzzy_t1", "fuzzy": {"file": "bad.fis"}}}
    with pytest.raises(InvalidScenario, match=re.escape(says)):
        parse_scenario(data, "data")


def test_default_beyond_the_greatest_change_is_refused(files):
    save(PAPER, "t1.fll")
    text = (files / "t1.fll").read_text()
    beyond, within = (re.sub("default: .*", f"default: {each}", text) for each in (5.0, -0.1))
    assert SystemFile("a.fll", within).system.outputs[0].fallback == -0.1
    with pytest.raises(InvalidFuzzyFile, match="'kp' is 5, its default, where no rule fires; need"):
        SystemFile("a.fll", beyond)


@pytest.mark.parametrize("preset", ["paper", "published-code"])
@pytest.mark.parametrize("kind", ["t1", "t2", "t3"])
def test_no_system_in_a_file_exceeds_the_greatest_change(kind, preset, files):
    """Gaussian sets fire rules at any input, also beyond the range of the inputs."""
    wide = tuple(
        replace(v, sets=tuple(replace(s, upper=Membership("gaussmf", (2.0, 0.0))) for s in v.sets))
        for v in PAPER.inputs
    )
    linear = of_functions(0.02, (0.05, -0.03))
    uneven = tuple(replace(each, low=-0.02, high=0.1) for each in PAPER.outputs)

    def infer(**changes):
        save(replace(PAPER, **changes), "a.fis")
        return gain_inference(kind, preset, FuzzyOptions(file="a.fis"))

    for outputs in (linear, of_functions(0.1, ()), uneven):
        found = np.abs(infer(inputs=wide, outputs=outputs).batch(5.0 * GRID))
        assert found.max() <= MAX_GAIN_CHANGE + 1e-12
        assert found.max() > 0.01
    assert infer(outputs=uneven)(5.0, 0.0).tolist() == pytest.approx([0.04] * 3)  # no rule fires
    assert gain_inference(kind, preset)(5.0, 0.0).tolist() == [0.0] * 3


@pytest.mark.parametrize(
    ("kind", "fuzzy", "says"),
    [
        ("fuzzy_t1", {"file": "absent.fis"}, "fuzzy: cannot read the fuzzy system absent.fis"),
        ("fuzzy_t1", {"file": "t1.fis", "kp": {"small": 0.2}}, "leave out kp"),
        ("fuzzy_t2", {"file": "t2.fis", "inputs": {"lag": 0.2}}, "leave out inputs"),
        ("fuzzy_t1", {"file": {"name": "a.fis", "content": "x"}}, "the file a.fis: line 1"),
        ("fuzzy_t1", {"file": {"name": "a.fis", "content": "x" * 1_000_001}}, "has more than"),
        ("fuzzy_t1", "t1.fis", "must hold keys, such as fuzzy.file=t1.fis for the system"),
    ],
)
def test_invalid_file_is_refused(kind, fuzzy, says, files):
    data = scenario_data(paper_scenario())
    data["controllers"] = {"mine": {"type": kind, "fuzzy": fuzzy}}
    with pytest.raises(InvalidScenario, match=re.escape(says)):
        parse_scenario(data, "data")


def test_scenario_names_the_file_relative_to_itself_and_keeps_its_content(files):
    (files / "in").mkdir()
    (files / "t1.fis").rename(files / "in" / "gains.fis")
    data = scenario_data(paper_scenario())
    data["controllers"] = {"mine": {"type": "fuzzy_t1", "fuzzy": {"file": "gains.fis"}}}
    (files / "in" / "s.yaml").write_text(yaml.safe_dump(data))
    scenario = load_scenario(files / "in" / "s.yaml")
    content = (files / "in" / "gains.fis").read_text()
    file = scenario_data(scenario)["controllers"]["mine"]["fuzzy"]["file"]
    assert file == {"name": "gains.fis", "content": content}
    (files / "in" / "gains.fis").unlink()
    save_scenario(scenario, files / "copy.yaml")
    assert load_scenario(files / "copy.yaml").controllers == scenario.controllers
    save_controller(scenario.controllers["mine"], files / "mine.yaml")
    assert load_controller(files / "mine.yaml")["fuzzy"]["file"] == file
    shown = controller_types(scenario)["mine"]
    assert shown.parameters == "fuzzy.file.name = gains.fis"
    assert shown.fuzzy is None


def test_report_states_the_name_of_a_file_with_any_text_and_short_values_of_others(files):
    one_line_file = {"name": "a.fis", "content": (files / "t1.fis").read_text()}
    one_line_file["content"] = one_line_file["content"].replace("\n", "\r")
    data = scenario_data(paper_scenario())
    table = [[3] * 7] * 7
    data["controllers"] = {
        "filed": {"type": "fuzzy_t1", "fuzzy": {"file": one_line_file}},
        "ruled": {"type": "fuzzy_t1", "fuzzy": {"rules": {"kp": table, "ki": table}}},
    }
    shown = controller_types(parse_scenario(data, "data"))
    assert shown["filed"].parameters == "fuzzy.file.name = a.fis"
    assert shown["ruled"].parameters == f"fuzzy.rules.kp = {table}, fuzzy.rules.ki = {table}"


def test_report_shortens_a_long_text_of_a_parameter(tmp_path):
    (tmp_path / "law.py").write_text(
        "from dataclasses import dataclass\n"
        "@dataclass(frozen=True)\n"
        "class Options:\n"
        "    note: str = ''\n"
        "def law(context, options: Options): pass\n",
        encoding="utf-8",
    )
    for text, stated in (("a\nb", r"note = a\nb"), ("x" * 900, f"note = {'x' * 297}...")):
        law = configure("controllers", f"{tmp_path}/law.py:law", {"note": text})
        scenario = paper_scenario().model_copy(update={"controllers": {"law": law}})
        assert controller_types(scenario)["law"].parameters == stated


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
