"""Files with the parameters of one controller, in scenarios, studies and on the command line."""

import re

import pytest

from omnidrive.cli.components import with_controllers
from omnidrive.components import configure
from omnidrive.control.pid import gain_inference
from omnidrive.errors import InvalidInput, InvalidScenario
from omnidrive.fuzzy import save
from omnidrive.scenario import load_scenario, paper_scenario
from omnidrive.scenario.controller_file import FORMAT, load_controller, save_controller
from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
from omnidrive.study import load_definition, save_definition

TUNED = configure(
    "controllers", "fuzzy_t1", {"preset": "paper", "position": {"kp": 9.5}, "fuzzy": {
        "rules": {"kp": [[0] * 7] * 7}}}
)  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "in").mkdir()
    save_controller(TUNED, tmp_path / "in" / "tuned.yaml", ["by a test\nof two lines"])
    return tmp_path / "in"


def test_file_holds_type_and_parameters(folder):
    text = (folder / "tuned.yaml").read_text()
    assert text.splitlines()[0].startswith("# by a test")
    assert "- [0, 0, 0, 0, 0, 0, 0]" in text
    assert load_controller(folder / "tuned.yaml") == TUNED.plain()


def test_scenario_file_names_it_relative_to_itself(folder, monkeypatch):
    data = scenario_data(paper_scenario())
    for controllers, label in (
        ({"best": "tuned.yaml"}, "best"),
        (["pid", "tuned.yaml"], "tuned"),
    ):
        import yaml

        (folder / "s.yaml").write_text(yaml.safe_dump(data | {"controllers": controllers}))
        scenario = load_scenario(folder / "s.yaml")
        assert scenario.controllers[label] == TUNED
    study = {"format": "omnidrive-study-1", "name": "s", "scenario": data | {
        "controllers": {"best": "tuned.yaml"}}}  # fmt: skip
    (folder / "study.yaml").write_text(yaml.safe_dump(study))
    definition = load_definition(folder / "study.yaml")
    assert definition.scenario.controllers == {"best": TUNED}
    save_definition(definition, folder.parent / "copy.yaml")  # values, not the file
    (folder / "tuned.yaml").unlink()
    assert load_definition(folder.parent / "copy.yaml").scenario.controllers == {"best": TUNED}


@pytest.mark.parametrize("kind", ["fuzzy_t1", "mine.py:Mine"])
def test_file_names_its_fuzzy_system_relative_to_itself(folder, monkeypatch, kind):
    """Also that of a controller of one's own, whose code is not imported for it."""
    import yaml

    save(gain_inference("t1", "paper").system, folder / "gains.fis")
    (folder.parent / "mine.py").write_text(
        "from omnidrive.control.pid.options import FuzzyPidOptions\n"
        "class Mine:\n"
        "    def __init__(self, context, options: FuzzyPidOptions): pass\n"
        "    def reset(self, state): pass\n"
        "    def step(self, t, state, reference): pass\n",
        encoding="utf-8",
    )
    monkeypatch.chdir(folder.parent)
    own = {"type": kind, "fuzzy": {"file": "gains.fis"}}
    (folder / "mine.yaml").write_text(yaml.safe_dump({"format": FORMAT, **own}))
    data = scenario_data(paper_scenario())
    (folder.parent / "s.yaml").write_text(
        yaml.safe_dump(data | {"controllers": {"a": "in/mine.yaml"}})
    )
    (folder / "s.yaml").write_text(
        yaml.safe_dump(data | {"controllers": {"a": "mine.yaml", "b": own}})
    )
    scenarios = [
        load_scenario("s.yaml", allow_code=True),
        load_scenario("in/s.yaml", allow_code=True),
        with_controllers(paper_scenario(), ["a=in/mine.yaml"], allow_code=True),
    ]
    found = [each for scenario in scenarios for each in scenario.controllers.values()]
    assert len(found) == 4
    for each in found:
        assert each.values["fuzzy"]["file"]["name"] == "gains.fis"


def test_option_names_it(folder):
    file = str(folder / "tuned.yaml")
    scenario = with_controllers(
        paper_scenario(), [file, f"stiff={file},position.kp=20", "fuzzy_t2"]
    )
    assert list(scenario.controllers) == ["tuned", "stiff", "fuzzy_t2"]
    assert scenario.controllers["tuned"] == TUNED
    assert scenario.controllers["stiff"].parameters.position.kp == 20.0
    assert scenario.controllers["stiff"].parameters.fuzzy == TUNED.parameters.fuzzy


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("format: omnidrive-scenario-1", "is no controller file"),
        ("type: pid", "it has no format, need format: omnidrive-controller-1"),
        ("- 1", "is no controller file"),
        ("format: omnidrive-controller-1", "needs 'type'"),
        ("format: omnidrive-controller-1\ntype: pdi", "did you mean 'pid'"),
        ("format: omnidrive-controller-1\ntype: pid\nposition: {kp: -1}", "kp is -1 1/s"),
        (None, "No such file"),
    ],
)
def test_bad_files_are_refused(tmp_path, content, message):
    path = tmp_path / "bad.yaml"
    if content is not None:
        path.write_text(content)
    data = scenario_data(paper_scenario()) | {"controllers": {"a": str(path)}}
    with pytest.raises(InvalidScenario, match=re.escape(message)):
        parse_scenario(data, "data")
    with pytest.raises(InvalidInput, match=re.escape(message)):
        with_controllers(paper_scenario(), [str(path)])
