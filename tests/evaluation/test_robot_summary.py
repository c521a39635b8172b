"""Capabilities of robots, their warnings and their figure."""

import re
from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from omnidrive.evaluation.figures.robot_card import robot_card
from omnidrive.evaluation.tables.robot_summary import Capability, RobotSummary, support_margin
from omnidrive.robot import GRAVITY, ROBOTS, Mount, named_robot, omni_ring

SMALL = named_robot("small")


def test_capabilities_of_a_square_robot():
    """Four omni wheels at 45 degrees: speed w r sqrt(2) forwards, w r along a diagonal."""
    summary = RobotSummary.of(SMALL)
    rim = SMALL.max_wheel_speed * SMALL.wheel.radius
    assert summary.speed.along(np.array([0.0]))[0] == pytest.approx(sqrt(2.0) * rim)
    assert summary.speed.along(np.array([0.25 * pi]))[0] == pytest.approx(rim)
    assert summary.speed.yaw == pytest.approx(rim / 0.25)
    assert summary.speed.extremes == pytest.approx((rim, sqrt(2.0) * rim), rel=1e-4)
    # four wheels push with 1/sqrt(2) of mu m g / 4
    forwards = SMALL.friction * GRAVITY / sqrt(2.0)
    assert summary.acceleration.along(np.array([0.0]))[0] == pytest.approx(forwards)
    assert summary.condition == pytest.approx(sqrt(2.0))
    assert summary.warnings == ()


@pytest.mark.parametrize("name", ROBOTS)
def test_slices_lie_on_the_boundary_of_the_polytope(name):
    summary = RobotSummary.of(ROBOTS[name])
    angles = np.linspace(0.0, 2.0 * pi, 37)
    for capability in (summary.speed, summary.acceleration):
        for share in (0.0, 0.3, -0.7):
            yaw = share * capability.yaw
            values = capability.along(angles, yaw)
            points = np.array([values * np.cos(angles), values * np.sin(angles), 0 * angles + yaw])
            assert np.abs(capability.faces @ points).max(axis=0) == pytest.approx(1.0)
        assert (capability.along(angles, 1.1 * capability.yaw) == 0.0).all()


def test_without_a_wheel():
    square, kiwi = RobotSummary.of(SMALL), RobotSummary.of(named_robot("kiwi"))
    assert all(isinstance(left, Capability) for left in square.without)
    assert square.without[0].extremes[0] < 0.6 * square.acceleration.extremes[0]
    assert kiwi.without == (None, None, None)


def test_margin_of_the_support_polygon():
    assert support_margin(SMALL) == pytest.approx(0.25 / sqrt(2.0))
    assert support_margin(replace(SMALL, com=(0.1, 0.0))) == pytest.approx(0.25 / sqrt(2.0) - 0.1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mounts": omni_ring((0.0, 0.15, 0.3, pi), 0.25), "com": (0.05, 0.02)}, "badly cond"),
        ({"mounts": tuple(Mount(m.x + 0.1, m.y, m.axle_angle) for m in SMALL.mounts),
          "com": (0.1, 0.0), "body_radius": 0.5}, "couple y and yaw .*is the origin"),
        ({"body_radius": 0.2}, "footprint: a wheel reaches 0.26. m"),
        ({"assumed_effective_radius": 0.2}, "miscalibrated: .* 0.2 m, the wheels have 0.25 m"),
        ({"com": (0.12, 0.0)}, "unloaded: wheel [12] carries"),
        ({"com": (0.15, 0.0)}, "centre of mass: it is 0.027 m from the edge"),
        ({"com_height": 0.5}, "tipping: the robot tips at 3.47 m/s.2"),
    ],
)  # fmt: skip
def test_warnings(changes, message):
    warnings = RobotSummary.of(replace(SMALL, **changes)).warnings
    assert any(re.search(message, warning) for warning in warnings), warnings


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_named_robots_have_no_warnings(robot):
    assert RobotSummary.of(robot).warnings == ()


def test_one_wrong_sign_on_centred_wheels_is_named_instead_of_the_origin():
    first, *others = named_robot("mecanum").mounts
    mounts = (first._replace(roller_angle=-first.roller_angle), *others)
    warnings = RobotSummary.of(replace(named_robot("mecanum"), mounts=mounts)).warnings
    coupled = [each for each in warnings if each.startswith("asymmetric")]
    assert coupled
    assert all(each.endswith("the angles of the wheels, or its sign, wrong?") for each in coupled)


def test_swapped_rollers_are_a_warning():
    mecanum = named_robot("mecanum")
    swapped = tuple(m._replace(roller_angle=-m.roller_angle) for m in mecanum.mounts)
    warnings = RobotSummary.of(replace(mecanum, mounts=swapped)).warnings
    expected = (
        "weak rotation: the wheels turn the robot with an effective radius of 0.02 m, but are "
        "0.3 m from its centre; are the signs of roller_angle swapped?"
    )
    assert expected in warnings
    assert not any("weak rotation" in each for each in RobotSummary.of(mecanum).warnings)


@pytest.mark.parametrize("name", ROBOTS)
def test_figure_shows_wheels_polytopes_and_tables(name):
    robot = ROBOTS[name]
    figure = robot_card(RobotSummary.of(robot))
    above, speed, acceleration, matrix, lost = figure.axes
    shown = {text.get_text() for text in above.texts}
    assert {str(i) for i in range(len(robot.mounts))} <= shown
    assert len(speed.patches) == 3
    assert max(np.hypot(*line.get_xydata().T).max() for line in speed.lines) == pytest.approx(
        RobotSummary.of(robot).speed.extremes[1], rel=1e-4
    )
    assert len(matrix.tables[0].get_celld()) == 5 * (1 + len(robot.mounts))
    assert len(lost.tables[0].get_celld()) == 4 * (2 + len(robot.mounts))
    legend = [text.get_text() for text in acceleration.get_legend().get_texts()]
    assert any("without one of" in text for text in legend) == (name != "kiwi")
