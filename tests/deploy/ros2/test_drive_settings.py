"""Settings of drives in a graph of ROS 2."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from omnidrive.cli.drives.ros2_drive import _motion
from omnidrive.components.documentation import field_docs
from omnidrive.deploy.ros2.drive_settings import DriveSettings, read_parameters
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.robot import named_robot


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("holonomic-nmpc,horizn=15", "the controller holonomic-nmpc: .*did you mean 'horizon'"),
        ("holonomic-nmpc,horizon=-1", "horizon is -1 steps, need 1 to 200 steps"),
        ("pid,x=1", "the controller pid: has no parameter 'x'; there are preset"),
        ("nosuch", "there is no controller 'nosuch'"),
    ],
)
def test_wrong_parameters_of_the_controller_are_refused(text, message):
    settings = DriveSettings(robot="mecanum", controller=text)
    with pytest.raises(InvalidInput, match=message):
        settings.make_pipeline(settings.make_robot())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("/**: {ros__parameters: {1: 2}}", "the name of a parameter must be text, got 1"),
        ("/**: {ros__parameters: {1.5: 2, rate: 5}}", "must be text, got 1.5"),
        ("/**: {ros__parameters: {null: 2}}", "must be text, got None"),
        ("/**: {ros__parameters: {true: 2}}", "must be text, got True"),
        ("/**: {ros__parameters: {2026-11-26: 2}}", "the name of a parameter must be text|no para"),
        ("omnidrive_drive: {ros__parameters: {2: 1}}", "must be text, got 2"),
        ("/**: {ros__parameters: {rate: {a: 1}}}", "rate must be a float, got {'a': 1}"),
        ("/**: {ros__parameters: {rate: [1]}}", "rate must be a float"),
        ("/**: {ros__parameters: {command_type: [1]}}", "command_type is one of"),
        ("/**: {ros__parameters: {command_type: {a: 1}}}", "command_type is one of"),
        ("/**: {ros__parameters: {rate: .nan}}", "rate"),
        ("/**: {ros__parameters: {rate: 1e400}}", "rate"),
        ("/**: {ros__parameters: {rate: 1" + "0" * 400 + "}}", "rate"),
        ("/**: {ros__parameters: {robot: 2026-11-26}}", "robot must be a str|no robot"),
        ("/**: {ros__parameters: {controller: {1: 2}}}", "controller has no type"),
        ("/**: {ros__parameters: {controller: {type: pid, 1: {2: 3}}}}", "must be one value"),
        ("/**: {ros__parameters: {controller: {type: 5}}}", "controller has no type"),
        ("/**: {ros__parameters: {controller: {type: pid, 1: 2}}}", "parameter '1'"),
        ("/**: {ros__parameters: {initial_pose: [a, b]}}", "initial_pose is X,Y"),
        ("/**: {ros__parameters: {initial_pose: [{1: 2}, null, .inf]}}", "initial_pose is X,Y"),
        ("/**: {ros__parameters: {initial_pose: 5}}", "initial_pose must be a str"),
        ("/**: {rate: 5}", "has no mapping ros__parameters"),
        ("/**: [1, 2]", "has no mapping ros__parameters"),
        ("/**: null", "has no mapping ros__parameters"),
        ("/**: {ros__parameters: [1]}", "has no mapping ros__parameters"),
        ("- 1", "is not a parameter file of ROS 2"),
        ("", "is not a parameter file of ROS 2"),
        ("5", "is not a parameter file of ROS 2"),
        ("{}", "no parameters of omnidrive_drive; its nodes are none"),
        ("other: {ros__parameters: {rate: 5}}", "its nodes are 'other'"),
        ("1: {ros__parameters: {rate: 5}}", "its nodes are 1$"),
        ("? [1, 2]\n: 3", "is not a YAML parameter file"),
    ],
)
def test_wrong_parameter_files_are_refused_in_one_sentence(tmp_path, text, message):
    path = tmp_path / "p.yaml"
    path.write_text(text, encoding="utf-8")

    def read():
        """Make a pipeline from the file."""
        settings = DriveSettings().with_values(read_parameters(path), "p.yaml: ")
        settings.make_pipeline(settings.make_robot())

    with pytest.raises(InvalidInput, match=message) as caught:
        read()
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 500


def test_parameters_of_every_node_and_of_this_one_are_joined(tmp_path):
    path = tmp_path / "p.yaml"
    path.write_text(
        "other: {ros__parameters: {1: 2}}\n/**: {ros__parameters: {rate: 20, margin: 1}}\n"
        "/omnidrive_drive: {ros__parameters: {rate: 30}}\n",
        encoding="utf-8",
    )
    assert read_parameters(path) == {"rate": 30.0, "margin": 1.0}


def test_a_parameter_that_a_reference_lacks_is_an_error_of_the_user():
    with pytest.raises(InvalidInput, match=r"circle: .*has no parameter 'duration'"):
        _motion("circle,duration=6", named_robot("mecanum"), Pose(0.0, 0.0, 0.0), None)


def test_documentation_lists_every_parameter_with_its_default_and_meaning():
    text = (Path(__file__).parents[3] / "docs" / "ros2.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.*) \| (.*) \|$", text.split("| parameter |")[1], re.M)
    meanings = field_docs(DriveSettings)
    shown = {None: "`null`", False: "`false`", (): "`[]`"}
    for (name, default, meaning), each in zip(rows, fields(DriveSettings), strict=False):
        assert (name, meaning) == (each.name, meanings[each.name])
        assert default == shown.get(each.default, f"`{each.default}`"), name
    assert len(rows) >= len(fields(DriveSettings))


def test_unknown_parameters_name_a_near_one_or_all_in_order():
    with pytest.raises(InvalidInput, match="no parameter 'max_sped'; did you mean 'max_speed'"):
        DriveSettings().with_values({"max_sped": 1.0})
    names = sorted(each.name for each in fields(DriveSettings))
    with pytest.raises(InvalidInput) as caught:
        DriveSettings().with_values({"xyzzy": 1.0})
    assert str(caught.value).endswith(f"; there are {', '.join(names)}")
