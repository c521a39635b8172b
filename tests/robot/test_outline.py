"""Outlines of robots."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from omnidrive.errors import InvalidInput, InvalidRobot
from omnidrive.robot import load_robot, named_robot
from omnidrive.robot.robot_file import parse_robot, robot_schema, robot_text

BOX = ((0.254, 0.215), (-0.254, 0.215), (-0.254, -0.215), (0.254, -0.215))
NAV2 = "[[0.254, 0.215], [-0.254, 0.215], [-0.254, -0.215], [0.254, -0.215]]"
MECANUM = named_robot("mecanum")


def content(**changes):
    data = yaml.safe_load(robot_text(MECANUM)) | changes
    return {key: value for key, value in data.items() if value != "left out"}


@pytest.mark.parametrize("outline", [[list(corner) for corner in BOX], NAV2])
def test_radius_is_derived_from_the_outline(outline):
    robot = parse_robot(content(outline=outline, body_radius="left out"), "test")
    assert robot.outline == BOX
    assert robot.body_radius == pytest.approx(np.hypot(0.254, 0.215))
    assert parse_robot(content(outline=outline), "test").body_radius == MECANUM.body_radius


def test_outline_round_trips(tmp_path):
    robot = replace(MECANUM, outline=BOX)
    (tmp_path / "robot.yaml").write_text(robot_text(robot), encoding="utf-8")
    assert load_robot(tmp_path / "robot.yaml") == robot
    assert "outline:" not in robot_text(MECANUM)


def test_concave_outline_is_accepted():
    chevron = ((0.33, 0.0), (-0.21, 0.27), (-0.07, 0.0), (-0.21, -0.27))
    with pytest.raises(InvalidInput, match="contain the origin"):
        replace(MECANUM, outline=tuple((x + 0.15, y) for x, y in chevron))
    assert replace(MECANUM, outline=chevron).outline == chevron


@pytest.mark.parametrize(
    ("outline", "fault"),
    [
        ([[0.2, 0.1], [-0.2, 0.1]], "at least three corners"),
        ([[0.2, 0.2], [-0.2, -0.2], [-0.2, 0.2], [0.2, -0.2]], "not a simple polygon"),
        ([[0.2, float("nan")], [-0.2, 0.1], [0.0, -0.2]], r"outline\[0\] is nan"),
        ([[0.3, 0.1], [0.1, 0.1], [0.1, 0.2]], "contain the origin"),
        ([[0.5, 0.2], [-0.3, 0.2], [-0.3, -0.2]], "beyond body_radius 0.37 m"),
        ([[0.2, 0.1, 0.0], [-0.2, 0.1], [0.0, -0.2]], "a list of corners"),
        ([[0.2, "x"], [-0.2, 0.1], [0.0, -0.2]], "must be a number"),
        ("0.3 0.2", "needs corners such as"),
        (3000 * "[", "needs corners such as"),
        (7, "a list of corners"),
    ],
)
def test_faults_are_one_message(outline, fault):
    with pytest.raises(InvalidRobot, match=fault):
        parse_robot(content(outline=outline), "test")
    if "beyond" not in fault:
        with pytest.raises(InvalidRobot, match=fault):
            parse_robot(content(outline=outline, body_radius="left out"), "test")


def test_radius_or_outline_is_required():
    with pytest.raises(InvalidRobot, match="'body_radius' is missing"):
        parse_robot(content(body_radius="left out"), "test")
    assert {"required": ["outline"]} in robot_schema()["anyOf"]


def test_drawing_shows_the_outline():
    assert replace(MECANUM, outline=BOX)._repr_html_() != MECANUM._repr_html_()
