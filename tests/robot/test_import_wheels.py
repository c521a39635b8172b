"""Wheels of imported robots: fixed or steered axles, rollers, wheels without rollers."""

from math import atan, cos, degrees, pi, radians, sin, tan

import numpy as np
import pytest

from omnidrive.errors import InvalidRobot
from omnidrive.robot.imports import import_robot
from tests.robot.descriptions import mecanum_urdf, omni_urdf
from tests.shared_data import shared

CORNERS = {"fl": (0.2, 0.15), "fr": (0.2, -0.15), "rl": (-0.2, 0.15), "rr": (-0.2, -0.15)}
CYLINDER = (
    '<inertial><mass value="0.5"/></inertial><collision><origin rpy="1.5707963 0 0"/>'
    '<geometry><cylinder radius="0.06" length="0.03"/></geometry></collision>'
)


@pytest.fixture
def imported(tmp_path):
    """Import a text as a file of a name."""

    def load(text, name="robot.urdf", **options):
        (tmp_path / name).write_text(text)
        return import_robot(tmp_path / name, **options)

    return load


def forked(joint, axis, limits="", corners=CORNERS, name="robot", arm="arm"):
    """URDF of four wheels, each on a fork that moves relative to the base."""
    text = (
        f'<robot name="{name}"><link name="base_link"><inertial><mass value="9"/></inertial></link>'
    )
    for n, (x, y) in corners.items():
        text += (
            f'<link name="{n}_fork"/><link name="{n}_wheel">{CYLINDER}</link>'
            f'<joint name="{n}_{arm}" type="{joint}"><parent link="base_link"/>'
            f'<child link="{n}_fork"/><origin xyz="{x} {y} 0"/><axis xyz="{axis}"/>{limits}</joint>'
            f'<joint name="{n}_drive" type="continuous"><parent link="{n}_fork"/>'
            f'<child link="{n}_wheel"/><origin xyz="0 0 -0.05"/><axis xyz="0 1 0"/></joint>'
        )
    return text + "</robot>"


def mjcf_fork(joints):
    """MJCF of four wheels with more joints of their bodies before the one of the wheel."""
    bodies = "".join(
        f'<body name="{n}_wheel" pos="{x} {y} 0.05">{joints.replace("NAME", n)}'
        f'<joint name="{n}_drive" axis="0 1 0"/><geom type="cylinder" size="0.05 0.02" '
        'euler="90 0 0" mass="0.5"/></body>'
        for n, (x, y) in CORNERS.items()
    )
    return (
        '<mujoco model="mecanum"><worldbody><body name="base" pos="0 0 0.1"><freejoint/>'
        f'<geom type="box" size="0.2 0.1 0.05" mass="8"/>{bodies}</body></worldbody></mujoco>'
    )


def rollers(axis_angle, phase, skews, count=6):
    """URDF of four wheels with roller joints, turned by ``phase``."""
    text = '<robot name="base"><link name="base_link"><inertial><mass value="9"/></inertial></link>'
    for (n, (x, y)), skew in zip(CORNERS.items(), skews, strict=True):
        text += (
            f'<link name="{n}_wheel">{CYLINDER}</link><joint name="{n}_drive" type="continuous">'
            f'<parent link="base_link"/><child link="{n}_wheel"/>'
            f'<origin xyz="{x} {y} 0" rpy="0 {phase} {axis_angle}"/><axis xyz="0 1 0"/></joint>'
        )
        for k in range(count):
            a = 2.0 * pi * k / count
            axis = (cos(skew) * cos(a), sin(skew), -cos(skew) * sin(a))
            out = 0.05 * np.array([sin(a), 0.0, cos(a)]) + 0.02 * np.array(axis)  # not the middle
            text += (
                f'<link name="{n}_r{k}"><inertial><mass value="0.01"/></inertial></link>'
                f'<joint name="{n}_roller{k}" type="continuous"><parent link="{n}_wheel"/>'
                f'<child link="{n}_r{k}"/><origin xyz="{out[0]} {out[1]} {out[2]}"/>'
                f'<axis xyz="{axis[0]:.9f} {axis[1]:.9f} {axis[2]:.9f}"/></joint>'
            )
    return text + "</robot>"


@pytest.mark.parametrize("file", ["steered.urdf", "steered_axle_names.urdf"])
@pytest.mark.parametrize("named", [False, True])
def test_wheels_on_steering_joints_are_refused(file, named):
    names = [f"{n}_wheel_joint" for n in CORNERS] if named else []
    joint = "axle" if "axle" in file else "steer"
    path = shared(f"cases/01-swerve-imported-as-mecanum/{file}")
    with pytest.raises(InvalidRobot, match=f"fl_wheel_joint on fl_{joint}_joint, fr_wheel_joint"):
        import_robot(path, wheels=names)


@pytest.mark.parametrize(
    "text",
    [
        forked("continuous", "0 0 1", name="mecanum"),
        forked("continuous", "0 1e-17 -1"),
        forked("revolute", "0 0 1", '<limit lower="-0.5" upper="0.5"/>'),  # Ackermann
        forked("revolute", "0.3 0 1", '<limit lower="-0.5" upper="0.5"/>'),  # inclined king pin
        forked("prismatic", "1 0 0", '<limit lower="-0.1" upper="0.1"/>'),
        forked("continuous", "0 1 0"),  # wheels on wheels
        forked("floating", "1 0 0"),
        forked("planar", "0 0 1"),
        forked("continuous", "0 0 1", arm="caster_rotation").replace("_drive", "_caster_wheel"),
        mjcf_fork('<joint name="NAME_arm" axis="0 0 1"/>'),
        mjcf_fork('<joint name="NAME_arm" axis="0 0 1" range="-30 30"/>'),
        mjcf_fork('<joint name="NAME_arm" type="slide" axis="0 1 0"/>'),
    ],
)
def test_wheels_that_move_relative_to_the_base_are_refused(imported, text):
    with pytest.raises(InvalidRobot, match=r"fl_\w+ on fl_(arm|caster_rotation), .* by --wheel"):
        imported(text, mecanum="caster" not in text)


@pytest.mark.parametrize(
    "text",
    [
        forked("prismatic", "0 0 1", '<limit lower="-0.02" upper="0.02"/>'),
        forked("revolute", "1 0 0", '<limit lower="-0.08" upper="0.08"/>'),  # rocker
        mjcf_fork('<joint name="NAME_arm" type="slide" axis="0 0 1"/>'),
    ],
)
def test_suspensions_are_taken_as_rigid(imported, text):
    found = imported(text, mecanum=True)
    assert any("rigid suspension, without fl_arm, fr_arm" in fact for fact in found.guessed)
    assert not found.warnings
    assert found.robot.effective_radius == pytest.approx(0.35)


def test_joints_that_move_the_whole_base_or_are_locked_are_no_steering(imported):
    locked = forked("revolute", "0 0 1", '<limit lower="0" upper="0"/>')
    assert imported(locked, mecanum=True).robot.effective_radius == pytest.approx(0.35)
    whole = mecanum_urdf().replace('name="base_joint" type="fixed"', 'name="yaw" type="continuous"')
    assert imported(whole).robot.effective_radius == pytest.approx(0.38)


def test_a_differential_base_with_casters_is_refused(imported):
    drive = {"left": (0.0, 0.2), "right": (0.0, -0.2)}
    fixed = forked("fixed", "0 0 1", corners={n: drive[n] for n in drive})
    casters = forked("continuous", "0 0 1", corners={"front": (0.3, 0.0), "back": (-0.3, 0.0)})
    inner = casters.partition("</inertial></link>")[2].replace("_drive", "_caster_wheel")
    with pytest.raises(InvalidRobot, match="front_caster_wheel on front_arm"):
        imported(fixed.replace("</robot>", inner))
    parallel = forked("fixed", "0 0 1", corners=drive | {"front": (0.3, 0.0), "back": (-0.3, 0.0)})
    with pytest.raises(
        InvalidRobot, match=r"not at the corners of a rectangle.*: left_drive, right"
    ):
        imported(parallel)


def test_parallel_wheels_without_rollers_are_a_guess_with_a_warning(imported):
    plain = imported(mecanum_urdf())
    assert "skid-steered robots look the same" in plain.warnings[0]
    assert "--mecanum" in plain.warnings[0]
    stated = imported(mecanum_urdf(), mecanum=True)
    assert stated.robot == plain.robot
    assert not stated.warnings
    assert any("45 degrees, as stated" in fact for fact in stated.read)
    named = imported(mecanum_urdf().replace("my_base", "my_mecanum_base"))
    assert not named.warnings
    assert any("contains 'mecanum'" in fact for fact in named.guessed)


@pytest.mark.parametrize("word", ["skid_steer", "libgazebo_ros_diff_drive.so", "DiffDrive"])
def test_parallel_wheels_of_a_skid_steered_robot_are_refused(imported, word):
    plugin = f'<gazebo><plugin name="p" filename="{word}"/></gazebo></robot>'
    text = mecanum_urdf().replace("</robot>", plugin)
    with pytest.raises(InvalidRobot, match="cannot move sideways; --mecanum"):
        imported(text)
    assert imported(text, mecanum=True).robot == imported(mecanum_urdf()).robot


def test_six_parallel_wheels_are_refused(imported):
    six = forked("fixed", "1 0 0", corners=CORNERS | {"ml": (1e-17, 0.15), "mr": (0.0, -0.15)})
    with pytest.raises(InvalidRobot, match=r"not at the corners of a rectangle.*: ml_drive, mr"):
        imported(six, mecanum=True)


@pytest.mark.parametrize("file", [f"mecanum_{n}_{at}_at_bottom.xml"
                                  for n in (6, 8, 12) for at in ("gap", "roller")])  # fmt: skip
def test_the_angle_of_the_wheel_does_not_change_the_roller_angle(file):
    robot = import_robot(shared(f"cases/04-roller-angle-depends-on-wheel-angle/{file}")).robot
    angles = [degrees(mount.roller_angle) for mount in robot.mounts]
    assert angles == pytest.approx([45.0, -45.0, -45.0, 45.0], abs=1e-6)


@pytest.mark.parametrize("phase", [0.0, pi / 6.0, 0.3, 1.0])
@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_rollers_of_urdf_give_the_roller_angle(imported, phase, turn):
    skews = [radians(a) for a in (45.0, -45.0, -45.0, 45.0)]
    found = imported(rollers(turn, phase, skews))
    tilts = [m.roller_angle for m in found.robot.mounts]
    assert np.abs(tilts) == pytest.approx(np.full(4, pi / 4.0), abs=1e-8)
    assert tilts == pytest.approx([tilts[0], -tilts[0], -tilts[0], tilts[0]], abs=1e-8)
    assert not found.warnings


def test_roller_angles_other_than_45_degrees_are_read(imported):
    skew = atan(1.5 * tan(0.5))
    found = imported(rollers(0.0, 0.2, [skew, -skew, -skew, skew], count=8))
    assert abs(found.robot.mounts[0].roller_angle) == pytest.approx(skew, abs=1e-8)


def test_a_roller_angle_of_rounding_errors_is_that_of_an_omni_wheel(imported):
    """Written angles and axes have few digits; their rounding makes no mecanum wheel."""
    text = omni_urdf()
    for name in ("omni0", "omni1", "omni2"):
        text = text.replace(
            "</robot>",
            "".join(
                f'<link name="{name}_{k}"/><joint name="{name}_roller{k}" type="continuous">'
                f'<parent link="{name}_wheel_link"/><child link="{name}_{k}"/>'
                f'<origin xyz="{0.04 * sin(k):.6f} 0 {0.04 * cos(k):.6f}"/>'
                f'<axis xyz="{cos(k):.6f} 1e-17 {-sin(k):.6f}"/></joint>'
                for k in range(6)
            )
            + "</robot>",
        )
    text = text.replace("1.5707963267948966 0 0", "1.5708 0 0").replace("0.5235987755982988",
                                                                        "0.5236")  # fmt: skip
    found = imported(text)
    assert [mount.roller_angle for mount in found.robot.mounts] == [0.0, 0.0, 0.0]
    assert found.robot.wheel.rows == 2
    assert found.robot.wheel.rollers == 6


def test_a_kiwi_of_rounded_angles_has_omni_wheels(imported):
    text = omni_urdf().replace('axis xyz="0 1 0"', 'axis xyz="3e-17 1 -6.1e-17"')
    found = imported(text)
    assert all(mount.roller_angle == 0.0 for mount in found.robot.mounts)
    assert found.robot.chassis.jacobian == pytest.approx(
        imported(omni_urdf()).robot.chassis.jacobian, abs=1e-9
    )


def test_wheels_of_which_some_have_rollers_are_refused(imported):
    text = rollers(0.0, 0.0, [0.8, -0.8, -0.8, 0.8])
    text = text.replace('"rr_wheel"/><child link="rr_r', '"base_link"/><child link="rr_r')
    with pytest.raises(InvalidRobot, match="only some wheels have rollers; without: rr_drive"):
        imported(text)


def test_rollers_of_different_angles_are_refused(imported):
    text = rollers(0.0, 0.0, [0.8, -0.8, -0.8, 0.8])
    axis = f"{cos(0.8):.9f} {sin(0.8):.9f} "
    with pytest.raises(InvalidRobot, match="rollers of the wheel fl_drive are inclined by differ"):
        imported(text.replace(axis, f"{cos(0.8):.9f} {-sin(0.8):.9f} ", 1))
