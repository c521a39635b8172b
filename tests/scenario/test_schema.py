"""JSON schemas of scenario and robot files, and the reference page that is made from one."""

import importlib.util
import json
from pathlib import Path

import pytest
import yaml

from omnidrive.components import component_names
from omnidrive.parameter import Bounds
from omnidrive.robot import ROBOTS
from omnidrive.robot.robot_file import robot_schema, robot_text
from omnidrive.scenario import Scenario, paper_scenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.schema import scenario_schema

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def schema():
    return scenario_schema()


@pytest.fixture(scope="module")
def page():
    spec = importlib.util.spec_from_file_location("page", DOCS / "mkdocs" / "scenario_page.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.scenario_page()


def objects(schema):
    """Yield every schema of an object within ``schema``."""
    if isinstance(schema, dict):
        if "properties" in schema:
            yield schema
        for each in schema.values():
            yield from objects(each)
    elif isinstance(schema, list):
        for each in schema:
            yield from objects(each)


def test_every_key_of_a_scenario_is_described(schema):
    keys = {f"{name}" for each in objects(schema) for name in each["properties"]}
    assert {"sample_time", "horizon", "position_sigma", "turn_within", "yaw"} <= keys
    without = [
        name
        for each in objects(schema)
        for name, value in each["properties"].items()
        if not {"description", "const", "$ref", "pattern"} & value.keys()
    ]
    assert without == []


def test_keys_and_required_keys_are_those_of_the_model(schema):
    fields = Scenario.model_fields
    assert list(schema["properties"]) == list(fields)
    assert set(schema["required"]) == {name for name in fields if fields[name].is_required()}
    assert schema["additionalProperties"] is False


def test_range_unit_and_default_of_a_number(schema):
    found = schema["properties"]["sample_time"]
    (bounds,) = (m for m in Scenario.model_fields["sample_time"].metadata if isinstance(m, Bounds))
    assert (found["minimum"], found["maximum"], found["unit"]) == bounds
    assert found["default"] == 0.1
    assert found["description"].endswith("Range: 0.005 to 1 s.")


def test_parameters_of_every_installed_controller(schema):
    _, by_label = schema["properties"]["controllers"]["anyOf"]
    options = by_label["additionalProperties"]["anyOf"]
    named = {
        each["properties"]["type"]["const"]: each["properties"]
        for each in options
        if "const" in each.get("properties", {}).get("type", {})
    }
    assert list(named) == options[0]["enum"] == list(component_names("controllers"))
    assert named["holonomic-nmpc"]["horizon"]["maximum"] == 200
    assert named["feedforward"]["position"]["unit"] == "1/s"


def test_references_within_the_schema_exist(schema):
    text = json.dumps(schema)
    named = {part.split('"')[0] for part in text.split('"#/$defs/')[1:]}
    assert named == set(schema["$defs"])


def test_scenario_has_only_keys_of_the_schema(schema):
    def check(data, found):
        found = schema["$defs"][found["$ref"].split("/")[-1]] if "$ref" in found else found
        if isinstance(data, dict) and "properties" in found:
            assert data.keys() <= found["properties"].keys()
            for name, value in data.items():
                check(value, found["properties"][name])

    check(scenario_data(paper_scenario("recommended")), schema)


def test_keys_of_robot_files():
    found = robot_schema()
    for robot in ROBOTS.values():
        data = yaml.safe_load(robot_text(robot))
        assert data.keys() <= found["properties"].keys()
        assert set(found["required"]) <= data.keys()
        wheel, mount = found["properties"]["wheel"], found["properties"]["mounts"]["items"]
        assert data["wheel"].keys() == wheel["properties"].keys() >= set(wheel["required"])
        assert all(each.keys() == mount["properties"].keys() for each in data["mounts"])
    assert set(mount["required"]) == {"x", "y", "axle_angle"}


def test_committed_page_is_the_generated_one(page):
    assert (DOCS / "scenario.md").read_text(encoding="utf-8") == page, (
        "run python docs/mkdocs/scenario_page.py"
    )


def test_page_has_every_key_and_no_dead_link(page, schema):
    anchors = {line.strip("# ").lower().replace(" ", "-") for line in page.splitlines()
               if line.startswith("#")}  # fmt: skip
    links = {part.split(")")[0] for part in page.split("](#")[1:]}
    assert links <= anchors
    for each in objects(schema):
        for name in each["properties"]:
            assert f"`{name}" in page or name in {"x", "y", "yaw", "type", "kind"}


@pytest.mark.parametrize("kind", ["scenario", "robot"])
def test_verb_prints_the_schema(kind, capsys):
    from omnidrive.cli.main import load_verb

    load_verb("schema")([kind], standalone_mode=False)
    title = json.loads(capsys.readouterr().out)["title"]
    assert title == f"omnidrive {kind}"
