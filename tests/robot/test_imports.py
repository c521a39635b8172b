"""Import of robots from URDF, MJCF and parameters of ros2_control."""

from math import cos, pi, sin

import mujoco
import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidRobot
from omnidrive.robot import ROBOTS, load_robot, save_robot
from omnidrive.robot.imports import import_robot
from omnidrive.simulation.mujoco.robot_model import robot_mjcf
from tests.robot.descriptions import (
    MECANUM_CONTROLLER,
    MJCF,
    OMNI_CONTROLLER,
    mecanum_urdf,
    omni_urdf,
)


@pytest.fixture
def imported(tmp_path):
    """Import a text as a file of a name."""

    def load(text, name="robot.urdf", **options):
        (tmp_path / name).write_text(text)
        return import_robot(tmp_path / name, **options)

    return load


def test_urdf_of_a_mecanum_robot(imported):
    found = imported(mecanum_urdf())
    robot = found.robot
    r, k = 0.05, 0.2 + 0.18
    expected = np.array([[1, -1, -k], [1, 1, k], [1, 1, -k], [1, -1, k]]) / r
    assert robot.chassis.jacobian == pytest.approx(expected, abs=1e-9)
    assert robot.name == "my_base"
    assert robot.mass == pytest.approx(20.0)
    assert robot.com == pytest.approx((0.176 / 20.0, 0.0))
    assert robot.com_height == pytest.approx((17.6 * 0.11 + 2.4 * 0.05) / 20.0)
    assert robot.body_inertia == pytest.approx(0.7)
    assert robot.wheel.total_mass == pytest.approx(0.6)
    assert (robot.max_torque, robot.max_wheel_speed) == (3.0, 30.0)
    assert robot.body_radius == pytest.approx(np.hypot(0.25, 0.2), abs=1e-9)  # corner of a wheel
    assert any("mecanum wheels with rollers at 45 degrees" in fact for fact in found.guessed)
    assert any(fact.startswith("friction: 0.8") for fact in found.missing)
    assert any(fact.startswith("servo_gain") for fact in found.missing)
    assert any(fact.startswith("lag") for fact in found.missing)


def test_axes_to_the_right_reverse_the_wheel_speeds_only(imported):
    plain = imported(mecanum_urdf()).robot
    flipped = imported(mecanum_urdf(flipped=("front_right", "rear_left"))).robot
    signs = np.array([[1], [-1], [-1], [1]])
    assert flipped.chassis.jacobian == pytest.approx(signs * plain.chassis.jacobian, abs=1e-9)


def test_urdf_of_an_omni_robot(imported):
    found = imported(omni_urdf())
    jacobian = found.robot.chassis.jacobian
    assert np.abs(jacobian[:, 2]) == pytest.approx(np.full(3, 0.2 / 0.05), abs=1e-6)
    assert all(mount.roller_angle == 0.0 for mount in found.robot.mounts)
    assert any("omni wheels" in fact for fact in found.guessed)


def test_wheels_can_be_named_and_ordered(imported):
    names = [f"{corner}_wheel_joint" for corner in
             ("rear_right", "rear_left", "front_right", "front_left")]  # fmt: skip
    robot = imported(mecanum_urdf(), wheels=names, wheel_radius=0.06).robot
    assert [(m.x, m.y) for m in robot.mounts] == [(-0.2, -0.18), (-0.2, 0.18), (0.2, -0.18),
                                                  (0.2, 0.18)]  # fmt: skip
    assert robot.wheel.radius == 0.06


def test_an_imported_robot_survives_a_round_trip(imported, tmp_path):
    found = imported(mecanum_urdf())
    save_robot(found.robot, tmp_path / "r.yaml", notes=found.missing)
    assert load_robot(tmp_path / "r.yaml") == found.robot


@pytest.mark.parametrize("name", ROBOTS)
def test_mjcf_of_the_named_robots(imported, name):
    """Models of the plant, with every roller as a body."""
    robot = ROBOTS[name]
    found = imported(robot_mjcf(robot, "rollers"), "robot.xml")
    tilted = 0.006 if name == "mecanum" else 1e-9  # rollers compensate the mean projected angle
    rows = np.array(found.robot.mounts)
    assert rows[:, :2] == pytest.approx(np.array(robot.mounts)[:, :2], abs=1e-9)
    assert np.sin(rows[:, 2] - np.array(robot.mounts)[:, 2]) == pytest.approx(0.0, abs=1e-8)
    assert rows[:, 3] == pytest.approx(np.array(robot.mounts)[:, 3], abs=tilted)
    for attribute in ("mass", "max_torque", "servo_gain"):
        expected = getattr(robot, attribute)
        assert getattr(found.robot, attribute) == pytest.approx(expected), attribute
    assert found.robot.body_inertia == pytest.approx(robot.frame_inertia)
    for attribute in ("radius", "mass", "rotor_inertia", "roller_radius", "roller_mass"):
        expected = getattr(robot.wheel, attribute)
        assert getattr(found.robot.wheel, attribute) == pytest.approx(expected), attribute
    assert found.robot.wheel.rollers == robot.wheel.rollers


def test_mjcf_masses_and_axes_equal_those_of_mujoco(imported):
    found = imported(MJCF, "cart.xml")
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    robot = found.robot
    assert robot.mass == pytest.approx(model.body_subtreemass[1], rel=1e-9)
    base = data.xpos[1]
    for k, mount in enumerate(robot.mounts):
        x, y, _ = data.xanchor[1 + k] - base
        assert (mount.x, mount.y) == pytest.approx((x, y), abs=1e-9)
        axis = data.xaxis[1 + k]
        assert (-cos(mount.axle_angle), -sin(mount.axle_angle)) == pytest.approx(
            tuple(axis[:2]), abs=1e-6
        )
    assert robot.body_inertia == pytest.approx(model.body_inertia[1].max(), rel=1e-6)
    assert (robot.servo_gain, robot.max_torque, robot.max_wheel_speed) == (2.0, 4.0, 20.0)
    assert robot.wheel.rotor_inertia == 0.001


def test_parameters_of_the_mecanum_drive_controller(imported):
    """Kinematics of mecanum_drive_controller/src/odometry.cpp."""
    found = imported(MECANUM_CONTROLLER, "controllers.yaml")
    r, k = 0.05, 0.38
    for front_left, rear_left, rear_right, front_right in np.eye(4):
        wheels = [front_left, front_right, rear_left, rear_right]  # order of the import
        twist = found.robot.chassis.twist(wheels)
        assert twist.vx == pytest.approx(0.25 * r * (sum(wheels)))
        assert twist.vy == pytest.approx(
            0.25 * r * (-front_left + rear_left - rear_right + front_right)
        )
        assert twist.yaw_rate == pytest.approx(
            0.25 * r / k * (-front_left - rear_left + rear_right + front_right)
        )
    assert found.robot.name == "base_controller"
    assert any("fl_joint, fr_joint, rl_joint, rr_joint" in fact for fact in found.read)
    assert any(fact.startswith("mass: 15 kg") for fact in found.missing)


def test_offset_of_the_base_frame(imported):
    x0, y0, turn = 0.1, -0.05, 0.3
    text = MECANUM_CONTROLLER.replace(
        "{ x: 0.0, y: 0.0, theta: 0.0 }", f"{{ x: {x0}, y: {y0}, theta: {turn} }}"
    )
    centre = imported(MECANUM_CONTROLLER, "a.yaml").robot.chassis
    base = imported(text, "b.yaml").robot.chassis
    wheels = [1.0, 2.0, -0.5, 3.0]
    v, w = centre.twist(wheels), base.twist(wheels)
    vx, vy = v.vx - v.yaw_rate * y0, v.vy + v.yaw_rate * x0  # at the base, in the centre's axes
    c, s = cos(turn), sin(turn)
    assert tuple(w) == pytest.approx((c * vx + s * vy, c * vy - s * vx, v.yaw_rate))


def test_parameters_of_the_omni_wheel_drive_controller(imported):
    """Kinematics of omni_wheel_drive_controller/src/odometry.cpp."""
    found = imported(OMNI_CONTROLLER, "controllers.yaml")
    angles = [0.5 + 2.0 * pi * i / 3.0 for i in range(3)]
    expected = np.array([[sin(a), -cos(a), -0.2] for a in angles]) / 0.02
    assert found.robot.chassis.jacobian == pytest.approx(expected)


def test_flat_parameter_names_are_read(imported):
    text = """
/**:
  ros__parameters:
    kinematics.wheels_radius: 0.05
    kinematics.sum_of_robot_center_projection_on_X_Y_axis: 0.38
"""
    assert imported(text, "flat.yml").robot.effective_radius == pytest.approx(0.38)


ENTITIES = """<?xml version="1.0"?>
<!DOCTYPE robot [<!ENTITY file SYSTEM "file:///etc/passwd">]>
<robot name="&file;"/>"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not XML"),
        ("<robot>", "not XML"),
        ("<sdf/>", "root element is <sdf>, need <robot> .URDF. or <mujoco> .MJCF."),
        (ENTITIES, "line 2, column 1[0-9]?: a DOCTYPE is not supported"),
        ("<robot>" + "<a/>" * 20_001 + "</robot>", "more than 20000 elements"),
        ("<robot>" + "<a>" * 40 + "</a>" * 40 + "</robot>", "nested more than 32 deep"),
        ("<robot/>", "expected one root link, got 0"),
        ('<robot><link name="a"/><link name="b"/></robot>', "expected one root link, got 2"),
        ('<robot><link name="a"/></robot>', "0 wheels found by axis and name, need 3 to 16"),
        (mecanum_urdf().replace('xyz="0.2 0.18 0"', 'xyz="0.2 nan 0"'), "needs 3 finite numbers"),
        (mecanum_urdf().replace('xyz="0.2 0.18 0"', 'xyz="0.2 0.1"'), "needs 3 finite numbers"),
        (mecanum_urdf().replace("0.05 0", "${r} 0", 1).replace('"0 0 0.05"', '"0 0 ${r}"'),
         "expand the file by xacro first"),
        (mecanum_urdf().replace('mass value="17.6"', 'mass value="-1"'),
         "mass: value must not be negative, got -1"),
        (MJCF.replace('mass="10"', 'mass="-10"'), "geom: mass must not be negative, got -10"),
        (MJCF.replace('density="500"', 'density="-1"'), "geom: density must not be negative"),
        (mecanum_urdf().replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), "axis of a joint is zero"),
        (mecanum_urdf().replace("continuous", "bolted"), "unknown type of joint 'bolted'"),
        (mecanum_urdf().replace('child link="front_left', 'child link="x'), "there is no link 'x"),
        (mecanum_urdf().replace('child link="front_left', 'child link="front_right'),
         "has two parents"),
        (mecanum_urdf().replace("<cylinder", "<mesh"), "radius of the wheel .* by --wheel-radius"),
        (mecanum_urdf().replace('radius="0.05"', 'radius="0.07"', 1), "radii of 0.05 to 0.07 m"),
        (MJCF.replace("<worldbody>", '<include file="/etc/passwd"/><worldbody>'),
         "<include> is not supported"),
        (MJCF.replace("<worldbody>", '<replicate count="1000000000"/><worldbody>'),
         "<replicate> is not supported"),
        ("<mujoco/>", "there is no body in worldbody"),
        (mecanum_urdf().replace('child link="front_left', 'child link="x&#10;\x7f'),
         r"there is no link 'x\\n\\x7f_wheel_link'"),
        (MJCF.replace('kv="2"', 'kv="1e-320"'), "a lag of the robot .*, got inf s"),
        (MJCF.replace('size="0.25 0.18', 'size="1e308 0.18'), "inertia of 'base' is not finite"),
        (mecanum_urdf().replace('<mass value="17.6"', '<mass value="1e999"'), "finite"),
    ],
)  # fmt: skip
def test_bad_descriptions_are_refused_with_one_sentence(imported, text, message):
    with pytest.raises(InvalidRobot, match=message) as caught:
        imported(text)
    assert "robot.urdf" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1", "there are no parameters of a mecanum_drive_controller"),
        ("[1, 2]", "there are no parameters"),
        (MECANUM_CONTROLLER.replace("0.38", "wide"), "must be a number, got 'wide'"),
        (MECANUM_CONTROLLER.replace("wheels_radius: 0.05", "wheels_radius: 0"), "must be positive"),
        (MECANUM_CONTROLLER.replace("sum_of", "summ_of"), "X_Y_axis is missing"),
        (OMNI_CONTROLLER.replace("[front, left, right]", "[a, b]"), "a list of 3 to 16 names"),
        (OMNI_CONTROLLER.replace("[front, left, right]", "abc"), "a list of 3 to 16 names"),
    ],
)
def test_bad_parameter_files_are_refused_with_one_sentence(imported, text, message):
    with pytest.raises(InvalidRobot, match=message) as caught:
        imported(text, "c.yaml")
    assert "c.yaml" in str(caught.value)


def test_a_description_of_many_wheels_is_refused_soon(imported):
    links = "".join(f'<link name="w{k}"/>' for k in range(2_000))
    joints = "".join(
        f'<joint name="wheel{k}" type="continuous"><parent link="w0"/><child link="w{k}"/></joint>'
        for k in range(1, 2_000)
    )
    with pytest.raises(InvalidRobot, match="more than 16 wheels found by axis and name"):
        imported(f"<robot>{links}{joints}</robot>")


def test_unknown_joints_and_formats_are_refused(imported):
    with pytest.raises(InvalidRobot, match="there is no hinge 'fl'; there are front_left_wheel"):
        imported(mecanum_urdf(), wheels=["fl"])
    with pytest.raises(InvalidInput, match="there is no format 'urfd'; did you mean 'urdf'"):
        imported(mecanum_urdf(), format="urfd")
    with pytest.raises(InvalidRobot, match="rank 2, need 3"):
        imported(mecanum_urdf(), wheels=["front_left_wheel_joint", "rear_left_wheel_joint"])
    with pytest.raises(InvalidRobot, match="--wheel is for URDF and MJCF"):
        imported(MECANUM_CONTROLLER, "c.yaml", wheels=["fl"])
