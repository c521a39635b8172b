"""Parameter files of mecanum controllers with other names than those of ros2_controllers."""

import pytest

from omnidrive.errors import InvalidRobot
from omnidrive.robot.imports import import_robot
from tests.robot.descriptions import MECANUM_CONTROLLER, OMNI_CONTROLLER
from tests.shared_data import shared

TYPE = "mecanum_drive_controller/MecanumDriveController"


@pytest.fixture
def imported(tmp_path):
    """Import the text of a parameter file."""

    def load(text):
        (tmp_path / "c.yaml").write_text(text)
        return import_robot(tmp_path / "c.yaml")

    return load


def halves(found):
    """Radius, half wheelbase and half track, m."""
    mount = found.robot.mounts[0]
    return pytest.approx((found.robot.wheel.radius, mount.x, mount.y), rel=1e-12)


@pytest.mark.parametrize("file", ["separations", "base_and_track", "upstream_names"])
def test_common_names_give_the_same_wheel_matrix(file):
    found = import_robot(shared(f"cases/12-mecanum-yaml-separations/{file}.yaml"))
    assert found.robot.wheel.radius == 0.05
    assert found.robot.effective_radius == pytest.approx(0.27)
    assert any("in this order: fl, fr, rl, rr" in fact for fact in found.read)
    if file != "upstream_names":
        assert halves(found) == (0.05, 0.15, 0.12)
        assert not any("half wheelbase" in fact for fact in found.guessed)


ROS_1 = f"""
mobile_base_controller:
  type: "{TYPE}"
  front_left_wheel_joint: fl
  front_right_wheel_joint: fr
  back_left_wheel_joint: rl
  back_right_wheel_joint: rr
  publish_rate: 50
  wheel_separation_x: 0.2
  wheel_separation_y: 0.3
  wheel_radius: 0.05
"""
ROS_2 = """
/robot1/base:
  ros__parameters:
    front_left_wheel_name: fl
    front_right_wheel_name: fr
    rear_left_wheel_name: rl
    rear_right_wheel_name: rr
    wheel_separation_x: 0.2
    wheel_separation_y: 0.3
    wheel_radius: 0.05
"""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (ROS_1, (0.05, 0.1, 0.15)),
        (ROS_2, (0.05, 0.1, 0.15)),
        (ROS_1 + "  wheel_separation_x_multiplier: 1.5\n", (0.05, 0.15, 0.15)),
        (ROS_1 + "  wheel_separation_multiplier: 2\n", (0.05, 0.2, 0.3)),
        (ROS_1 + "  wheel_radius_multiplier: 1.1\n", (0.055, 0.1, 0.15)),
        (ROS_2.replace("separation_x", "base").replace("separation_y", "track"),
         (0.05, 0.1, 0.15)),
        (ROS_2.replace("separation_x", "base").replace("separation_y", "separation"),
         (0.05, 0.1, 0.15)),
        (ROS_2.replace("separation_x", "base").replace("wheel_separation_y", "track_width"),
         (0.05, 0.1, 0.15)),
        (ROS_2.replace("wheel_radius", "wheels_radius") + "    wheels_radius_multiplier: 2\n",
         (0.1, 0.1, 0.15)),
        ("robot1:\n" + ROS_2.replace("/robot1/", "").replace("\n", "\n  "), (0.05, 0.1, 0.15)),
        ("controller_manager:\n  ros__parameters:\n    base.type: " + TYPE + ROS_2,
         (0.05, 0.1, 0.15)),
        (f"controller_manager:\n  ros__parameters:\n    base:\n      type: {TYPE}\n"
         "      kinematics:\n        wheels_radius: 0.05\n        wheel_base: 0.2\n"
         "        wheel_track: 0.3\n",
         (0.05, 0.1, 0.15)),
        (f"base: {{type: {TYPE}, wheel_radius: 0.05, wheels_k: 0.25}}", (0.05, 0.125, 0.125)),
    ],
)  # fmt: skip
def test_names_of_ros_1_and_of_makers_are_read(imported, text, expected):
    assert halves(imported(text)) == expected


def test_the_first_of_several_controllers_is_taken_with_a_warning(imported):
    found = imported(MECANUM_CONTROLLER + OMNI_CONTROLLER + ROS_2)
    assert found.robot.name == "base_controller"
    (warning,) = found.warnings
    assert warning.startswith("the controller base_controller is taken, the first of several")
    assert {"omni_controller", "base"} == set(warning.rpartition(": ")[2].split(", "))
    assert not imported(MECANUM_CONTROLLER).warnings


DIFFERENTIAL = """
controller_manager:
  ros__parameters:
    base: {type: diff_drive_controller/DiffDriveController}
base:
  ros__parameters:
    left_wheel_names: [l]
    wheel_separation: 0.3
    wheel_radius: 0.05
"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (DIFFERENTIAL, r"its controllers are base \(diff_drive_controller/DiffDriveController\)"),
        (DIFFERENTIAL.replace("type", "typ"), "its keys are left_wheel_names, wheel_separation"),
        (ROS_2.replace("separation_", "distance_"), "its keys are front_left_wheel_name"),
        (ROS_1.replace("separation_", "distance_"), "X_Y_axis is missing.* wheel_distance_x"),
        (ROS_1.replace("separation_y", "distance_y"), "so is wheel_separation_y"),
        (ROS_1.replace("wheel_radius", "r"), "wheel_radius is missing; its keys are type, front"),
        (ROS_1 + "  wheel_radius_multiplier: 0\n", "wheel_radius_multiplier must be positive"),
        (ROS_1 + "  wheel_radius_multiplier: a\n", "must be a number, got 'a'"),
        (ROS_1.replace("0.2", "-0.2"), "wheel_separation_x must be positive, got -0.2 m"),
        (ROS_1 + "  wheels_k: 0.5\n", "add up to 0.25 m .half of both., but .* is 0.5 m"),
        (ROS_1.replace("0.05", "$(var radius)"), "wheel_radius must be a number, got '.*radius"),
    ],
)  # fmt: skip
def test_other_parameter_files_are_refused_with_what_they_hold(imported, text, message):
    with pytest.raises(InvalidRobot, match=message) as caught:
        imported(text)
    assert "\n" not in str(caught.value)
