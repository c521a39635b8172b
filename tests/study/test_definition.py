"""Study files: forms of axes and random factors, and messages about all problems at once."""

import re
from datetime import date

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidScenario, InvalidStudy
from omnidrive.scenario import load_scenario
from omnidrive.study import (
    RunPlan,
    definition_data,
    load_definition,
    parse_definition,
    save_definition,
    study_names,
)

HEAD = {"format": "omnidrive-study-1", "name": "test", "scenario": "paper"}


def study(**keys):
    return parse_definition({**HEAD, **keys}, "study.yaml")


def problems(**keys):
    with pytest.raises(InvalidStudy) as error:
        study(**keys)
    return str(error.value)


def first_axis(source, path="sample_time"):
    (axis,) = study(axes={path: source}).axes
    return axis


def test_values_of_an_axis_are_a_list_or_a_grid():
    assert first_axis([0.05, 0.1]).labels == (0.05, 0.1)
    assert first_axis({"from": 0.1, "to": 0.2, "count": 3}).labels == (
        0.1,
        0.15000000000000002,
        0.2,
    )
    logarithmic = first_axis({"from": 0.01, "to": 1.0, "count": 3, "scale": "log"}).labels
    np.testing.assert_allclose(logarithmic, [0.01, 0.1, 1.0])


def test_values_of_sections_and_components_have_labels():
    assert first_axis(["planar", {"type": "kinematic"}], "plant").labels == ("planar", "kinematic")
    faults = {"named": {"none": [], "push": [{"kind": "push", "at": 5}]}}
    assert first_axis(faults, "faults").labels == ("none", "push")


def test_multiples_are_of_the_robot_in_the_scenario_also_if_it_is_an_axis():
    definition = study(
        axes={
            "robot.name": ["kiwi", "mecanum"],
            "plant_robot.mass": {"times": [1.0, 1.5]},
            "plant_robot.lag": {"times": [2.0]},
        },
        set={"tasks": {"track": {"durations": [60]}}, "controllers": ["feedforward"]},
    )
    from omnidrive.robot import named_robot

    plan = RunPlan(definition)
    found = [run.scenario.plant_robot for run in plan]
    expected = [
        (name, factor * named_robot(name).mass)
        for name in ("kiwi", "mecanum")
        for factor in (1, 1.5)
    ]
    assert [(each.name, each.mass) for each in found] == expected
    assert found[0].lag == pytest.approx([2.0 * each for each in named_robot("kiwi").lag])
    assert [run.factors["plant_robot.mass times"] for run in plan] == [1.0, 1.5, 1.0, 1.5]


def test_parameters_of_a_preset_have_paths_and_multiples():
    """Their values are not in the data of the scenario."""
    plan = RunPlan(
        study(
            scenario="recommended",
            axes={
                "controllers.fuzzy_t1.position.kp": {"times": [1.0, 2.0]},
                "controllers.pid.heading.ki": [0.5],
            },
            set={"tasks": {"track": {"durations": [20]}}},
        )
    )
    found = [run.scenario.controllers for run in plan if run.settings.controller == "fuzzy_t1"]
    first, second = (each["fuzzy_t1"].parameters.position.kp for each in found)
    resolved = plan.definition.scenario.controllers["fuzzy_t1"].resolved("recommended")
    assert first == resolved.parameters.position.kp
    assert second == 2.0 * first
    assert found[0]["pid"].parameters.heading.ki == 0.5
    text = problems(axes={"controllers.fuzzy_t1.position.kq": [1.0]})
    assert "did you mean 'controllers.fuzzy_t1.position.k" in text


def test_all_problems_of_fixed_settings_are_named_at_once():
    text = problems(set={"sampletime": 0.1, "plnt": "planar", "sample_time": 5.0, "seed": -1})
    for fact in ("'sampletime'", "'plnt'", "sample_time is 5 s", "seed is -1"):
        assert fact in text


BASE = {
    "robot": "paper",
    "plant": "planar",
    "controllers": ["feedforward"],
    "tasks": {"track": {"durations": [20]}},
}
CIRCLE, EIGHT = {"type": "circle", "radius": 2.0}, "eight"


@pytest.mark.parametrize(
    "axes",
    [
        {"reference": [CIRCLE, EIGHT]},
        {"reference": {"named": {"circle": CIRCLE, "eight": EIGHT}}},
        {"motion": {"cases": {"circle": {"reference": CIRCLE}, "eight": {"reference": EIGHT}}}},
    ],
)
def test_reference_that_varies_needs_none_in_the_base(axes):
    plan = RunPlan(study(scenario=BASE, axes=axes))
    assert [run.scenario.reference.type for run in plan] == ["circle", "eight"]
    assert plan[0].scenario.reference.values["radius"] == 2.0
    (name,) = axes
    assert [run.factors[name] for run in plan] == ["circle", "eight"]
    again = parse_definition(definition_data(study(scenario=BASE, axes=axes)), "study.yaml")
    assert [run.key for run in RunPlan(again)] == [run.key for run in plan]


@pytest.mark.parametrize("scenario", [BASE, {**BASE, "reference": CIRCLE}, "paper"])
def test_type_of_the_reference_varies_with_the_defaults_of_each(scenario):
    axes = {"reference.type": ["circle", "slalom"]}
    plan = RunPlan(study(scenario=scenario, axes=axes, set={"controllers": ["feedforward"]}))
    references = [run.scenario.reference for run in plan if run.settings.task == "track"]
    assert [each.type for each in references[:: len(references) // 2]] == ["circle", "slalom"]
    radius = 2.0 if "reference" in scenario else 1.0
    assert references[0].values["radius"] == radius
    assert "radius" not in references[-1].values


def test_planned_path_and_a_shape_are_types_of_the_reference():
    axes = {"reference.type": ["path", "circle"], "sample_time": [0.1]}
    plan = RunPlan(study(axes=axes, set={"controllers": ["feedforward"]}))
    assert plan[0].scenario.reference == "path"
    assert plan[len(plan) - 1].scenario.reference.type == "circle"


def test_other_sections_that_vary_need_none_in_the_base_either():
    path = {"map": {"source": "paper", "margin": 0.0}, "start": [1, 1, 0]}
    plan = RunPlan(study(scenario={**BASE, **path}, axes={"goal": [[8, 6], [5, 6]]}))
    assert [run.scenario.goal[:2] for run in plan] == [(8.0, 6.0), (5.0, 6.0)]
    assert study(scenario=BASE, set={"reference": "circle"}).scenario.reference.type == "circle"


@pytest.mark.parametrize(
    ("axes", "fact"),
    [
        ({"reference": []}, "map, start, goal missing"),
        ({"reference": ["circel"]}, "did you mean 'circle'"),
        ({"reference": {"cases": {"a": 3}}}, "map, start, goal missing"),
        ({"reference": {"named": 3}}, "map, start, goal missing"),
        ({"reference.radius": [1, 2]}, "map, start, goal missing"),
    ],
)
def test_reference_that_varies_wrongly_is_reported(axes, fact):
    assert fact in problems(scenario=BASE, axes=axes)


def test_cases_set_several_settings_together():
    cases = {"near": {"goal": [5, 6], "sample_time": 0.05}, "far": {"goal": [8, 6]}}
    plan = RunPlan(study(axes={"route": {"cases": cases}}, set={"controllers": ["pid"]}))
    found = {
        run.factors["route"]: (*run.scenario.goal[:2], run.scenario.sample_time) for run in plan
    }
    assert found == {"near": (5.0, 6.0, 0.05), "far": (8.0, 6.0, 0.1)}


def test_all_problems_are_named_at_once():
    text = problems(
        axes={
            "plant_robot.mas": [1],
            "sample_time": [5.0],
            "plant_robot.friction": {"times": ["2"]},
            "controllers.fuzzy_t3.preset": ["paper"],
        },
        random={
            "factors": {"goal.z": {"low": 0, "high": 1}, "timing.traction": {"low": 2, "high": 1}}
        },
        leave_out=[{"sample_tim": 5.0}],
    )
    for fact in (
        "no 'plant_robot.mas'; did you mean 'plant_robot.mass'?",
        "sample_time is 5 s, need 0.005 to 1 s",
        "plant_robot.friction: times: needs a list of numbers",
        "no 'controllers.fuzzy_t3.preset'; did you mean 'controllers.fuzzy_t",
        "no 'goal.z'; did you mean 'goal",
        "timing.traction: low is 2, larger than high, 1",
        "unknown axis 'sample_tim'; did you mean 'sample_time'?",
    ):
        assert fact in text


@pytest.mark.parametrize(
    ("keys", "fact"),
    [
        ({"format": "omnidrive-study-2"}, "another version of omnidrive; this one reads"),
        ({"format": "omnidrive-scenario-1"}, "is a scenario file; use omnidrive compare"),
        ({"axis": {}}, "unknown key 'axis'; did you mean 'axes'?"),
        ({"repetitions": 0}, "repetitions is 0, need 1 to"),
        ({"scenario": "recomended"}, "did you mean 'recommended'?"),
        ({"scenario": 3}, "must be a preset, a file or the keys of one"),
        ({"scenario": {"robot": {"name": "paper"}}}, "'tasks' is missing"),
        ({"set": {"plnt": "planar"}}, "did you mean 'plant'?"),
        ({"set": {"plant": "planer"}}, "did you mean 'planar'?"),
        ({"axes": {"sample_time": []}}, "sample_time: has no values"),
        ({"axes": {"sample_time": [0.1, 0.1]}}, "contains a value twice"),
        ({"axes": {"sample_time": {"from": 0.1, "to": 0.2, "count": 10**9}}}, "need 2 to 10000"),
        ({"axes": {"sample_time": {"from": 0, "to": 1, "count": 3, "scale": "log"}}}, "positive"),
        ({"axes": {"sample_time": 3}}, "need a list of values"),
        ({"axes": {"sample_time": {"cases": {"a": 3}}}}, "needs a mapping of settings"),
        ({"axes": {"watchdog.error": {"times": [2.0]}}}, "no number in the scenario to multiply"),
        ({"axes": {"plant": ["planar"], "plant.type": ["planar"]}}, "one setting varies twice"),
        ({"axes": {"format": ["x"]}}, "the scenario has no 'format'"),
        ({"axes": {"": [1]}}, "the scenario has no ''"),
        ({"axes": {"plant.": ["planar"]}}, "the scenario has no 'plant.'"),
        ({"axes": {"map": [{1: 2, "source": "none"}]}}, "map: the key 1 is no text"),
        (
            {"axes": {"plant": [date(2024, 1, 1)]}},
            "plant: datetime.date(2024, 1, 1) is a date, need",
        ),
        ({"random": {"factors": {"plant": {"choices": [b"a"]}}}}, "plant: b'a' is a bytes, need"),
        (
            {"random": {"factors": {"controllers": {"choices": [["pid"]]}}}},
            "pid changes which runs the study has, and a random factor must not: make it an axis",
        ),
        (
            {"random": {"factors": {"tasks.noise.repeats": {"low": 1, "high": 4}}}},
            "tasks.noise.repeats: the range changes which runs the study has",
        ),
        ({"axes": {"start.yaw": [9.0]}}, "is 9 rad, need -6.3 to 6.3 rad"),
        ({"axes": {"plant_robot.com": [[9.0, 0.0]]}}, "plant_robot.com"),
        ({"random": {"method": "sobolev"}}, "random.method"),
        ({"random": {"factors": {"sample_time": {"choices": []}}}}, "needs a list of values"),
        ({"random": {"factors": {"sample_time": {"low": 1}}}}, "with two numbers"),
        ({"leave_out": [{"task": "trak"}]}, "there is no task 'trak'; did you mean 'track'?"),
        ({"leave_out": [{"controller": "fuzzy_t4"}]}, "did you mean 'fuzzy_t"),
        ({"axes": {"sample_time": [0.1]}, "where": [{"sample_time": 0.2}]}, "there are 0.1"),
        ({"series": "some"}, "series"),
        ({"name": "a/b"}, "name"),
    ],
)
def test_each_problem_says_what_is_wrong(keys, fact):
    assert fact in problems(**keys)


CHOICES = {
    "robot": ["kiwi", {"name": "mecanum"}],
    "plant_robot": [None, "kiwi", {"name": "paper", "mass": 20.0}],
    "map": [{"source": "paper"}, {"source": "paper", "margin": 0.1}],
    "controllers.pid": ["pid", {"type": "pid", "position": {"kp": 3.5}}, {"type": "feedforward"}],
    "controllers.pid.position.kp": [None, 3.0],
    "reference": ["path", {"type": "circle", "radius": 1.0}],
    "sensors": [None, {"estimator": "kalman"}, {"estimator": "latest-fix"}],
    "faults": [[], [{"kind": "push", "at": 5}]],
    "plant": ["planar", {"type": "kinematic"}],
    "plant_robot.lag": [[0.1, 0.1], None],
    "start": [[1, 1], [1, 1.1, 0.1]],
    "goal.x": [8, 7.9],
    "path": [{"search": "greedy"}, {"search": "astar"}],
    "preset": ["paper", "recommended"],
    "sample_time": [0.05, 0.1, 0.05],
}


@pytest.mark.parametrize("path", CHOICES)
def test_values_mean_the_same_in_an_axis_and_in_a_random_factor(path):
    """Labels, scenarios and the saved file; a repeated choice has twice the probability."""
    tasks = {"track": {"durations": [60]}}
    head = {**HEAD, "set": {"tasks": tasks, "controllers": ["pid"]}}
    values = CHOICES[path]
    unique = [each for k, each in enumerate(values) if each not in values[:k]]
    axis = parse_definition({**head, "axes": {path: unique}}, "x")
    random = parse_definition(
        {**head, "random": {"factors": {path: {"choices": values}}}, "repetitions": 16}, "x"
    )
    expected = {run.factors[path]: run.scenario for run in RunPlan(axis)}
    assert len(expected) == len(unique)
    for definition in (random, parse_definition(definition_data(random), "x")):
        found = {run.factors[path]: run.scenario for run in RunPlan(definition)}
        assert {k: v.with_values(seed=1) for k, v in found.items()} == {
            k: v.with_values(seed=1) for k, v in expected.items()
        }
    drawn = [run.factors[path] for run in RunPlan(random)]
    assert drawn.count(0.05) in ({10, 11} if path == "sample_time" else {0})


def test_code_in_a_study_is_refused_unless_allowed(tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text(
        "format: omnidrive-study-1\nname: code\nscenario: paper\n"
        "axes: {plant: [planar, 'evil.py:Plant']}\n"
    )
    with pytest.raises(InvalidStudy, match="--allow-code"):
        load_definition(path)


def test_saved_study_is_the_same_study(tmp_path):
    """Also with a map and a robot file, whose names are relative to each file."""
    from omnidrive.maps import paper_map, save_nav2_map
    from omnidrive.robot import named_robot, save_robot

    here = tmp_path / "here"
    here.mkdir()
    save_nav2_map(paper_map(), here / "map.yaml")
    save_robot(named_robot("small"), here / "base.yaml")
    (here / "study.yaml").write_text(
        "format: omnidrive-study-1\nname: files\nscenario: paper\nrepetitions: 3\n"
        "axes:\n  map.source: [paper, map.yaml]\n"
        "  robot: {named: {small: {name: base.yaml}, paper: {name: paper}}}\n"
        "random: {factors: {plant_robot.mass: {times: {low: 0.8, high: 1.2}}}}\n"
        "leave_out: [{robot: small, task: step}]\n"
    )
    there = tmp_path / "there" / "copy.yaml"
    there.parent.mkdir()
    first = load_definition(here / "study.yaml")
    save_definition(first, there)
    second = load_definition(there)
    assert first.axes[0].labels == ("paper", "map.yaml")
    one, other = RunPlan(first), RunPlan(second)
    assert len(one) == len(other)
    assert one.keys(0, 100) == other.keys(0, 100)
    assert "../here/map.yaml" in there.read_text()


def test_studies_of_the_package_are_valid():
    for name in study_names():
        definition = load_definition(name)
        assert definition.name.startswith(name)
        assert definition.question.endswith("?")
        assert RunPlan(definition)[0].settings
    with pytest.raises(InvalidStudy, match="did you mean 'paper'"):
        load_definition("papr")


def test_changes_replace_settings_and_fix_axes():
    source = {**HEAD, "axes": {"sample_time": [0.05, 0.1]}}
    fixed = parse_definition(source, "x", changes={"sample_time": 0.2, "plant": "kinematic"})
    assert fixed.axes == ()
    assert fixed.scenario.sample_time == 0.2
    assert fixed.scenario.plant.type == "kinematic"


def test_changes_add_a_controller():
    changes = {"controllers.mine": {"type": "feedforward", "position": 9.0}}
    scenario = parse_definition(HEAD, "x", changes=changes).scenario
    assert scenario.controllers["mine"].values["position"] == 9.0
    assert list(scenario.controllers)[-1] == "mine"
    with pytest.raises(InvalidStudy, match=r"has no 'controllers\.mine\.position'"):
        parse_definition(HEAD, "x", changes={"controllers.mine.position": 9.0})


def test_further_repetitions_need_a_method_that_can_be_extended():
    factors = {"sample_time": {"low": 0.05, "high": 0.1}}
    fixed = study(random={"method": "latin-hypercube", "factors": factors}, repetitions=4)
    with pytest.raises(InvalidStudy, match="use sobol or independent"):
        fixed.with_repetitions(5)
    with pytest.raises(InvalidInput, match="need 1 to"):
        study().with_repetitions(0)


def test_distributions_are_stated_in_words():
    factors = {
        "sample_time": {"low": 0.05, "high": 0.1, "scale": "log"},
        "plant_robot.mass": {"times": {"low": 0.8, "high": 1.2}},
        "plant": {"choices": ["planar", "kinematic"]},
    }
    assert [each.distribution for each in study(random={"factors": factors}).random.factors] == [
        "0.05 to 0.1, uniform in the logarithm",
        "0.8 to 1.2",
        "one of planar, kinematic",
    ]


def test_text_of_a_file_is_shown_as_one_line():
    text = problems(axes={"plant\x1b[31m": [1], "a\nb": [2]})
    assert re.search(r"[\x00-\x1f]", text) is None


def test_data_of_a_study_has_no_empty_keys():
    data = definition_data(study(axes={"sample_time": [0.05, 0.1]}))
    assert set(data) == {"format", "name", "scenario", "axes", "random", "repetitions", "series"}


def test_a_study_file_is_not_taken_for_a_scenario(tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text("format: omnidrive-study-1\n", encoding="utf-8")
    with pytest.raises(InvalidScenario, match="is a study file; use omnidrive study"):
        load_scenario(path)
