"""Scenario files: round trip, error messages and retiming."""

import copy

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.components import component_names, find_component
from omnidrive.control import Command, FeedforwardGains
from omnidrive.errors import InvalidInput, InvalidScenario
from omnidrive.geometry import WorldTwist, to_body
from omnidrive.planning import Waypoint
from omnidrive.robot import named_robot
from omnidrive.scenario import (
    load_scenario,
    make_plant,
    map_scenario,
    paper_scenario,
    retime,
    robot_section,
    save_scenario,
)
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.tasks import DurationsTask, Tasks
from omnidrive.simulation.components import static_capabilities
from omnidrive.study import run_study
from tests.examples import examples
from tests.shared_data import shared
from tests.study.small import small_scenario


@pytest.mark.parametrize("preset", ["paper", "published-code", "recommended"])
def test_saved_scenario_round_trips(tmp_path, preset):
    scenario = paper_scenario(preset)
    save_scenario(scenario, tmp_path / "s.yaml")
    assert load_scenario(tmp_path / "s.yaml") == scenario


def test_map_path_is_relative_to_the_scenario_file(tmp_path):
    scenario = map_scenario(
        "map.yaml", Waypoint(1, 1), Waypoint(2, 2, 0.5), robot="small", name="x"
    )
    save_scenario(scenario, tmp_path / "s.yaml")
    again = load_scenario(tmp_path / "s.yaml")
    assert again.map.source == str(tmp_path / "map.yaml")
    assert (again.start, again.goal) == (scenario.start, scenario.goal)


def test_map_scenario_has_the_controllers_of_the_preset():
    def controllers(preset):
        waypoint = Waypoint(1, 1)
        return map_scenario(
            "m.yaml", waypoint, waypoint, robot="small", name="x", preset=preset
        ).controllers

    assert controllers("paper") == paper_scenario().controllers
    assert controllers("recommended") == paper_scenario("recommended").controllers


def is_short_line(folder, error):
    text = str(error).replace(str(folder), "")
    return text.encode() and text.isprintable() and len(text) < 600


def changed(*path, value):
    data = copy.deepcopy(scenario_data(paper_scenario()))
    section = data
    for key in path[:-1]:
        section = section[key]
    section[path[-1]] = value
    return data


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (changed("sead", value=1), "unknown key 'sead'; did you mean 'seed'?"),
        (changed("path", "serch", value=1), "unknown key 'path.serch'; did you mean 'search'?"),
        (changed("tasks", "trak", value=1), "unknown key 'tasks.trak'; did you mean 'track'?"),
        (
            changed("controllers", "feedforward", value={"type": "feedforward", "k": 1}),
            "controllers.feedforward has no parameter 'k'; there are position, heading",
        ),
        (
            changed("controllers", "pid", value={"type": "pid", "kp": 1}),
            "controllers.pid has no parameter 'kp'; did you mean position.kp or heading.kp?",
        ),
        (
            changed("controllers", "fuzzy_t1", value={"type": "fuzzy_t1", "rules": {"kp": []}}),
            "controllers.fuzzy_t1 has no parameter 'rules'; did you mean fuzzy.rules?",
        ),
        (changed("tasks", "track", "duration", value=1), "did you mean 'durations'?"),
        (changed("tasks", "track", "durations", value=["20 s"]), "number without a unit, got '20"),
        (changed("tasks", "track", "durations", value=[]), "at least 1 item"),
        (changed("tasks", "track", "durations", value=[-20]), "is -20 s, need 0.1 to 36000 s"),
        (changed("sample_time", value=100), "sample_time is 100 s, need 0.005 to 1 s"),
        (changed("sample_time", value=float("nan")), "sample_time: input should be a finite"),
        (changed("start", value=[1, 1, 90]), "is 90 rad, need -6.3 to 6.3 rad"),
        (changed("start", value=[1]), "'start.1' is missing"),
        (changed("start", value=[1, float("inf")]), "start.1: input should be a finite number"),
        (
            changed("controllers", "a", value={"type": "feedforward", "position": -1}),
            "controllers.a.position is -1 1/s, need 0",
        ),
        (changed("path", "turn_within", value=-1), "path.turn_within is -1 m, need 0 to 10 m"),
        (changed("path", "search", value="a*"), "path.search: input should be 'astar', 'jump-po"),
        (changed("path", "smooth", value="certified"), "path cannot be certified if it cuts"),
        (changed("timing", "law", value="fast"), "timing.law: input should be 'uniform', 'lim"),
        (changed("map", "unknown", value="maybe"), "map.unknown: input should be 'occupied' or"),
        (changed("map", "margin", value=-0.5), "map.margin is -0.5 m, need 0 to 10 m"),
        (
            changed("plant", value="rolers"),
            "plant: there is no plant 'rolers'; did you mean 'mujoco-rollers'?",
        ),
        (
            changed("controllers", value=["nmcp"]),
            "controllers.nmcp: there is no controller 'nmcp'; there are",
        ),
        (
            changed("controllers", "unicycle-nmpc", "horizon", value=0),
            "controllers.unicycle-nmpc.horizon is 0 steps, need 1 to 200 steps",
        ),
        (changed("tasks", value={}), "tasks has no task; there are track, noise"),
        (changed("format", value="omnidrive-scenario-2"), "format: input should be 'omnidrive-sc"),
        (changed("name", value="../../etc"), "name: string should match pattern"),
        (changed("tasks", "track", "durations", value=[20, 20.0]), "contains an item twice"),
        (
            {**changed("sample_time", value=0.005), "tasks": {"track": {"durations": [3600]}}},
            "has a run of 720000 samples, need at most 200000",
        ),
        (changed("tasks", "noise", "repeats", value=0), "repeats is 0 seeds, need 1 to 200 seeds"),
        (changed("tasks", "noise", "repeats", value=2.5), "repeats: input should be a valid int"),
        (changed("tasks", "track", "repeats", value=2), "unknown key 'tasks.track.repeats'"),
        (
            changed("tasks", "noise", value={"durations": [3600], "repeats": 30}),
            "has 1080000 samples with noise, need at most 1000000",
        ),
        (changed("seed", value=1.5), "seed: input should be a valid integer"),
        ({}, "'name' is missing"),
        (
            changed("sample-time", value=0.1),
            "unknown key 'sample-time'; did you mean 'sample_time'?",
        ),
        (
            changed("path", "turn-within", value=1),
            "'path.turn-within'; did you mean 'turn_within'?",
        ),
        (changed("start", value={"x": 1, "y": 1, "ya-w": 1}), "'start.ya-w'; did you mean 'yaw'?"),
        (changed("controllers", "fuzzy_t1", "pre set", value=1), "did you mean 'preset'?"),
        (
            changed("controllers", "fuzzy_t1", "a\nb", value=1),
            r"controllers.fuzzy_t1 has no parameter 'a\nb'; there are preset",
        ),
        (
            changed("controllers", "a b", value="pid"),
            "contains the label 'a b', need letters, digits",
        ),
        (changed("controllers", "x" * 9000, value="pid"), "xxx..., need letters, digits"),
        (changed("controllers", "a", value={"type": "y" * 9000}), "there is no controller 'yyyy"),
        (changed("controllers", "a", value={"type": 3}), "controllers.a needs 'type'"),
        (changed("controllers", "a", value=["pid"]), "controllers.a must be a name or a mapping"),
        (changed("controllers", value={"a": "pid", "A": "pid"}), "contains the label 'a' twice"),
        (changed("controllers", value=[["pid"]]), "controllers must be names, or a mapping of lab"),
        (changed("controllers", "a", value="mine.py:Law"), "is code that is not installed; if you"),
        (changed("controllers", "a", value="os:system"), "is code that is not installed; if you"),
        (changed("plant", "port", value=1), "plant has no parameter 'port'"),
        (changed("tasks", value=[]), "tasks must hold keys, such as track: ...; got []"),
        (changed("tasks", "track", "f[x]", value=1), "unknown key 'tasks.track.f[x]'"),
        (changed("", value=1), "unknown key ''; there are format, name"),
        (changed("a\nb", value=1), r"unknown key 'a\nb'; there are"),
        (changed("k" * 9000, value=1), "kkk...'; there are"),
        (changed(3, value=1), "unknown key 3; there are format, name"),
        (changed(None, value=1), "unknown key None; there are"),
        (changed(True, value=1), "unknown key True; there are"),
        (changed("controllers", "fuzzy_t1", 1.5, value=1), "unknown key 1.5"),
        (changed("\ud800", value=1), "input should be a valid string"),
        (changed("seed", value=10**400), "is not a YAML scenario: found an integer beyond"),
        (
            changed("seed", value=[1] * 3000),
            "seed must be a plain number without a unit, got [1, 1",
        ),
        (changed("map", "source", value="a\0b"), r"map.source must name a file, got 'a\x00b'"),
        (changed("map", "source", value=""), "map.source must name a file, got ''"),
        (
            changed("robot", "name", value="a\0.yaml"),
            r"robot.name must name a file, got 'a\x00.yaml'",
        ),
    ],
)
def test_message_names_the_invalid_key_and_the_valid_values(tmp_path, data, message):
    path = tmp_path / "s.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InvalidScenario) as caught:
        load_scenario(path)
    assert message in str(caught.value)
    assert is_short_line(tmp_path, caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [", "is not a YAML scenario"),
        ("nothing", "is not a scenario"),
        ("a: &a [x]\nb: [*a, *a]", "aliases"),
        ("!!python/object/apply:os.system ['true']", "is not a YAML scenario"),
        ("? [a]\n: 1", "is not a YAML scenario: .* unhashable key"),
        ("a: !!bool maybe", "is not a YAML scenario"),
        ("a: !!int ''", "is not a YAML scenario"),
        ("seed: 1:30", "seed must be a plain number without a unit, got '1:30'"),
        ("seed: 0x" + "f" * 5000, "seed must be a plain number without a unit, got '0xfff"),
        ("seed: " + "9" * 5000, "is not a YAML scenario: found an integer beyond"),
        (b"a: \xff", "is not a YAML scenario: 'utf-8' codec"),
        ("[" * 50_000, "is not a YAML scenario: it is nested more than 30 deep"),
        ("x" * 200_000, "too large"),
    ],
)
def test_hostile_files_are_refused(tmp_path, text, message):
    path = tmp_path / "s.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InvalidScenario, match=message) as caught:
        load_scenario(path)
    assert is_short_line(tmp_path, caught.value)


@pytest.mark.parametrize("text", ["nothing", "format: omnidrive-robot-1", "a: 1"])
def test_name_of_an_invalid_file_is_shown_in_one_line(tmp_path, text):
    path = tmp_path / "a\n\x1b[2J.yaml"
    path.write_text(text)
    with pytest.raises(InvalidScenario, match=r"a\\n\\x1b\[2J.yaml") as caught:
        load_scenario(path)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("folder", "cannot read the scenario .*folder: it is not a file"),
        ("loop", "cannot read the scenario .*loop: Too many levels"),
        ("a\0b", r"cannot read the scenario .*a\\x00b: embedded null byte"),
    ],
)
def test_path_that_is_not_a_file_is_rejected(tmp_path, name, message):
    (tmp_path / "folder").mkdir()
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(InvalidScenario, match=message):
        load_scenario(tmp_path / name)


VALID = scenario_data(paper_scenario())
SCALAR = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.dates(),
    st.text(),
    st.binary(),
    st.sampled_from([10**400, "5e-2", "\0", "a\nb", "\x1b[2J", "\ud800", "sample-time", "paper"]),
)
ANY_VALUE = st.recursive(
    SCALAR, lambda v: st.lists(v, max_size=4) | st.dictionaries(SCALAR, v, max_size=3), max_leaves=6
)
KEYS = [(k,) for k in VALID] + [(k, n) for k, v in VALID.items() if isinstance(v, dict) for n in v]


@st.composite
def mutated(draw):
    """Draw the text of a valid scenario with one value, key or piece of text replaced."""
    data = copy.deepcopy(VALID)
    *path, key = draw(st.sampled_from(KEYS))
    section = data[path[0]] if path else data
    change = draw(st.sampled_from(["value", "key", "text"]))
    if change == "value":
        section[key] = draw(ANY_VALUE)
    elif change == "key":
        section[draw(SCALAR)] = section.pop(key)
    text = yaml.safe_dump(data)
    if change == "text":
        a, b = sorted(draw(st.tuples(*[st.integers(0, len(text))] * 2)))
        text = (
            text[:a]
            + draw(st.text() | st.text("[]{}:,-&*!|>'\"#%@`? \n\t0.e", max_size=9))
            + text[b:]
        )
    return text.encode(errors="surrogatepass")


@examples(200)
@given(content=mutated() | st.binary() | st.text().map(str.encode))
def test_any_file_loads_or_raises_invalid_scenario(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("scenario") / "s.yaml"
    path.write_bytes(content)
    message = ""
    try:
        load_scenario(path)
    except InvalidScenario as error:
        message = str(error)
    assert message.isprintable()


def test_missing_file_is_named(tmp_path):
    with pytest.raises(InvalidScenario, match=r"none.yaml: No such file"):
        load_scenario(tmp_path / "none.yaml")


def test_retime_adapts_the_durations_to_the_path():
    source = str(shared("maps/nav2/depot.yaml"))
    scenario = map_scenario(
        source, Waypoint(2.0, 2.0), Waypoint(27.0, 13.0), robot="small", name="d"
    )
    usual, faster = retime(scenario), retime(scenario, speed=0.8)
    assert usual.tasks.track.durations[1] == pytest.approx(1.5 * usual.tasks.track.durations[0])
    ratio = usual.tasks.horizon.duration / faster.tasks.horizon.duration
    assert ratio == pytest.approx(0.8 / 0.5, rel=0.01)
    assert retime(scenario, duration=77.0).tasks.track.durations == (77.0, 115.5)


def test_retime_adds_no_tasks():
    tasks = Tasks(track=DurationsTask(durations=(40.0, 20.0)))
    scenario = paper_scenario().model_copy(update={"tasks": tasks})
    retimed = retime(scenario, duration=25.0).tasks
    assert retimed.track.durations == (50.0, 25.0)
    assert (retimed.noise, retimed.step, retimed.horizon) == (None, None, None)


@pytest.mark.parametrize("duration", [0.01, 30000.0, 1e9])
def test_durations_out_of_range_are_rejected(duration):
    with pytest.raises(InvalidInput, match=r"need 0\.1 to 36000 s"):
        retime(paper_scenario(), duration=duration)


def test_duplicate_key_is_rejected(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("name: a\nseed: 1\nseed: 2\n")
    with pytest.raises(InvalidScenario, match="found the key 'seed' twice"):
        load_scenario(path)


def test_capabilities_equal_those_of_the_plants():
    robot = named_robot("small")
    for name in component_names("plants"):
        capabilities = static_capabilities(find_component("plants", name).factory)
        if not capabilities.exclusive:  # it needs a running simulator
            plant = make_plant(robot, name)
            assert plant.capabilities == capabilities
            plant.close()


class PythonLaw:
    """A law that is given as a class."""

    def __init__(self, context, parameters: FeedforwardGains):
        self.position = parameters.position

    def reset(self, state):
        pass

    def step(self, t, state, reference):
        velocity = WorldTwist(*(self.position * v for v in reference.at(t).twist))
        return Command(to_body(velocity, state.pose.yaw))


@pytest.mark.long
def test_class_is_a_controller_in_worker_processes_too():
    controllers = {"mine": PythonLaw, "slow": {"type": PythonLaw, "position": 0.5}}
    tasks = Tasks(track=DurationsTask(durations=(20.0,)))
    scenario = small_scenario(controllers=controllers, tasks=tasks)
    one, two = (run_study(scenario, processes=count).records for count in (1, 2))
    assert [record.controller for record in one][:2] == ["mine", "slow"]
    assert [repr(r.metrics) for r in one] == [repr(r.metrics) for r in two]
    data = scenario_data(scenario)["controllers"]
    assert data["slow"]["type"].endswith("test_scenario:PythonLaw")


def test_plant_robot_differs_from_the_robot_of_the_controllers():
    slippery = {"name": "paper", "friction": 0.2}
    tasks = Tasks(track=DurationsTask(durations=(17.0,)))
    scenario = paper_scenario().with_values(
        plant="planar", controllers=("feedforward",), tasks=tasks
    )
    known = run_study(scenario).records[0].metrics["me"]
    wrong = run_study(scenario.with_values(plant_robot=slippery)).records[0].metrics["me"]
    both = run_study(scenario.with_values(robot=slippery)).records[0].metrics["me"]
    assert wrong == both  # the feedforward controller has no model of friction
    assert wrong > 2.0 * known


def test_message_names_at_most_ten_keys(tmp_path):
    keys = "".join(f"unknown{k}: 1\n" for k in range(5000))
    (tmp_path / "s.yaml").write_text(keys)
    with pytest.raises(InvalidScenario, match=r"; and 4994 more$") as caught:
        load_scenario(tmp_path / "s.yaml")
    assert str(caught.value).count("unknown key") == 6  # four keys are missing


@pytest.mark.parametrize("preset", ["paper", "published-code"])
def test_name_alone_is_a_robot(tmp_path, preset):
    """As with --robot; the wheel matrix of the published code included."""
    data = scenario_data(paper_scenario(preset)) | {"robot": "small", "plant_robot": "kiwi"}
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(data))
    scenario = load_scenario(tmp_path / "s.yaml")
    assert scenario.robot == robot_section("small", preset)
    assert scenario.plant_robot == robot_section("kiwi", preset)


def test_title_names_what_is_studied():
    """The preset, or the controller if there is only one."""
    titles = [
        run_study(small_scenario(controllers=names, plant="kinematic")).facts.name
        for names in (("feedforward", "pid"), ("feedforward",))
    ]
    assert titles == ["paper: preset paper, plant kinematic", "paper: feedforward, plant kinematic"]
