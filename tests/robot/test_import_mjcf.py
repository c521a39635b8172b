"""Robots from MJCF: motors, saved models, files that include and attach others."""

import mujoco
import numpy as np
import pytest

from omnidrive.errors import InvalidRobot
from omnidrive.robot.imports import import_robot
from tests.shared_data import shared

WHEELS = {"a": (0.1, 0.0, 0.0), "b": (-0.05, 0.0866, 2.0944), "c": (-0.05, -0.0866, -2.0944)}
JOINT = '<joint name="wheel_NAME" axis="1 0 0"/>'
GEOM = '<geom type="cylinder" size="0.05 0.01" euler="0 1.5707963 0" mass="0.2"/>'


def model(actuator="", defaults="", base="", wheel=JOINT + GEOM, sections=""):
    """MJCF of three omni wheels with the same actuator."""
    bodies = "".join(
        f'<body name="wheel_{n}" pos="{x} {y} 0.05" euler="0 0 {yaw}">'
        f"{wheel.replace('NAME', n)}</body>"
        for n, (x, y, yaw) in WHEELS.items()
    )
    motors = "".join(actuator.replace("NAME", n) for n in WHEELS)
    return (
        f'<mujoco model="own"><compiler angle="radian"/>{sections}<default>'
        f'{defaults}</default><worldbody><body name="base" pos="1 2 0">'
        '<freejoint/><geom type="cylinder" size="0.12 0.03" pos="0 0 0.08" mass="3"/>'
        f"{base}{bodies}</body></worldbody><actuator>{motors}</actuator></mujoco>"
    )


VALUES = ("max_wheel_speed", "max_torque", "servo_gain", "mass")


def values(found):
    return tuple(getattr(found.robot, key) for key in VALUES)


@pytest.fixture
def both(tmp_path):
    """Import a model and the same saved by MuJoCo; the values must be equal bit for bit."""

    def load(text):
        (tmp_path / "own.xml").write_text(text)
        saved = mujoco.MjModel.from_xml_path(str(tmp_path / "own.xml"))
        mujoco.mj_saveLastXML(str(tmp_path / "saved.xml"), saved)
        found = [import_robot(tmp_path / f"{name}.xml") for name in ("own", "saved")]
        assert values(found[0]) == values(found[1])
        assert found[0].missing == found[1].missing
        assert found[0].warnings == found[1].warnings
        return found[0]

    return load


@pytest.mark.parametrize("name", ["own", "own_motor"])
def test_a_saved_model_gives_the_values_of_the_original(name):
    folder = shared("cases/03-saved-mjcf-loses-motors")
    found = [import_robot(folder / f"{file}.xml") for file in (name, f"{name}_saved")]
    assert values(found[0]) == values(found[1])
    expected = {"own": (9.0, 1.5, 0.4), "own_motor": (30.0, 1.5, 0.3)}[name]
    assert values(found[0])[:3] == expected


SERVO = 'biastype="affine" gainprm="0.3" biasprm="0 0 -0.3"'


@pytest.mark.parametrize(
    ("actuator", "defaults", "speed", "torque", "gain"),
    [
        ('<velocity joint="wheel_NAME" kv="0.3" ctrlrange="-7 7" gear="2" forcerange="-1 1"/>', "",
         3.5, 2.0, 1.2),
        (f'<general joint="wheel_NAME" {SERVO} ctrlrange="-7 7"/>', "", 7.0, None, 0.3),
        ('<general joint="wheel_NAME" class="v"/>',
         f'<default class="w"><general {SERVO}/><default class="v"><general ctrlrange="-7 7"/>'
         "</default></default>", 7.0, None, 0.3),
        ('<general joint="wheel_NAME"/>', f"<general {SERVO}/>", None, None, 0.3),
        ('<general joint="wheel_NAME" gainprm="2" ctrlrange="-1 1" gear="3"/>', "",
         None, 6.0, None),
        ('<motor joint="wheel_NAME" ctrlrange="-9 9" ctrllimited="false"/>', "", None, None, None),
        ('<motor joint="wheel_NAME" ctrlrange="-9 9"/>',
         '<joint actuatorfrcrange="-0.7 0.7"/>', None, 0.7, None),
        ('<intvelocity joint="wheel_NAME" kp="5" actrange="-9 9" ctrlrange="-6 6"/>', "",
         6.0, None, None),
        ('<dcmotor joint="wheel_NAME" nominal="12 2 100" ctrlrange="-12 12"/>', "",
         100.0, 2.0, 0.02),
        ('<position joint="wheel_NAME" kp="3" ctrlrange="-3 3"/>', "", None, None, None),
    ],
)  # fmt: skip
def test_motors_equal_those_of_mujoco(both, actuator, defaults, speed, torque, gain):
    found = both(model(actuator, defaults))
    read = (found.robot.max_wheel_speed, found.robot.max_torque, found.robot.servo_gain)
    names = ("max_wheel_speed", "max_torque", "servo_gain")
    for name, value, expected in zip(names, read, (speed, torque, gain), strict=True):
        assert any(fact.startswith(name) for fact in found.missing) == (expected is None), name
        assert expected is None or value == pytest.approx(expected, rel=1e-12), name


@pytest.mark.parametrize(
    "size", ['dyntype="user" actdim="500000000"', 'nsample="500000000" delay="1" interp="linear"']
)
def test_states_and_histories_of_any_size_are_not_allocated(tmp_path, size):
    torque = 'joint="wheel_NAME" gainprm="2" ctrlrange="-1 1"'
    (tmp_path / "own.xml").write_text(model(f"<general {torque} {size}/>"))
    assert import_robot(tmp_path / "own.xml").robot.max_torque == 2.0


def test_actuators_of_other_kinds_are_named_in_a_warning(tmp_path):
    text = model('<damper joint="wheel_NAME" name="brake_NAME" kv="0.2" ctrlrange="0 3"/>')
    text = text.replace("</actuator>", '<motor name="winch" tendon="rope"/></actuator>')
    (tmp_path / "a.xml").write_text(text)
    first, second = import_robot(tmp_path / "a.xml").warnings
    assert first == "actuators that act on no joint are not read: winch"
    assert second.endswith("servos of one hinge are not read: brake_a, brake_b, brake_c")


def test_models_without_their_meshes_are_read(tmp_path):
    mesh = '<geom type="mesh" mesh="shell" material="red"/>'
    text = model(
        base='<geom class="visual" mesh="shell"/>',
        defaults='<default class="visual"><geom type="mesh" mass="0.5" material="red"/></default>',
        wheel=JOINT + GEOM + mesh.replace("/>", ' mass="0.05"/>'),
        sections='<asset><mesh name="shell" file="none.stl"/><material name="red" rgba="1 0 0 1"/>'
        "</asset>",
    )
    (tmp_path / "a.xml").write_text(text)
    found = import_robot(tmp_path / "a.xml")
    assert found.robot.mass == pytest.approx(3.0 + 3 * 0.2 + 0.5 + 3 * 0.05)
    assert found.robot.wheel.radius == pytest.approx(0.05)
    assert not found.warnings
    (tmp_path / "a.xml").write_text(text.replace(' mass="0.05"', ""))
    found = import_robot(tmp_path / "a.xml")
    assert "mass of meshes is not read" in found.warnings[0]
    assert "wheel_a, wheel_b" in found.warnings[0]
    assert any(fact.startswith("mass: 15 kg") for fact in found.missing)


MOTOR = '<velocity joint="wheel_NAME" kv="0.4" ctrlrange="-9 9" forcerange="-1.5 1.5"/>'


def test_included_files_are_read_as_by_mujoco(tmp_path):
    (tmp_path / "parts").mkdir()
    whole = model(MOTOR)
    start, end = whole.index('<body name="wheel_a"'), whole.index("</body></worldbody>")
    (tmp_path / "whole.xml").write_text(whole)
    (tmp_path / "main.xml").write_text(
        whole[:start] + '<include file="parts/wheels.xml"/>' + whole[end:]
    )
    wheels = whole[start:end].split("</body>")
    (tmp_path / "parts" / "wheels.xml").write_text(
        f'<mujocoinclude>{wheels[0]}</body><include file="parts/rest.xml"/></mujocoinclude>'
    )
    (tmp_path / "parts" / "rest.xml").write_text(
        f"<mujocoinclude>{'</body>'.join(wheels[1:])}</mujocoinclude>"
    )
    mujoco.MjModel.from_xml_path(str(tmp_path / "main.xml"))  # it is a model of MuJoCo
    expected, found = (import_robot(tmp_path / f"{name}.xml") for name in ("whole", "main"))
    assert found.robot == expected.robot
    assert found.missing == expected.missing


def test_attached_models_are_read_as_by_mujoco(tmp_path):
    (tmp_path / "wheel.xml").write_text(
        '<mujoco model="module"><compiler angle="degree"/><default><joint armature="0.002"/>'
        '</default><worldbody><body name="wheel"><joint name="wheel" axis="1 0 0"/><geom '
        'type="cylinder" size="0.05 0.01" euler="0 90 0" mass="0.2"/></body></worldbody>'
        '<actuator><velocity name="m" joint="wheel" kv="0.4" ctrlrange="-9 9"/></actuator></mujoco>'
    )
    frames = "".join(
        f'<frame pos="{x} {y} 0.05" euler="0 0 {yaw}"><attach model="module" body="wheel" '
        f'prefix="{n}_"/></frame>'
        for n, (x, y, yaw) in WHEELS.items()
    )
    text = (
        '<mujoco><compiler angle="radian"/><asset><model name="module" file="wheel.xml"/></asset>'
        '<worldbody><body name="base"><freejoint/><geom type="cylinder" size="0.12 0.03" mass="3"/>'
        f"{frames}</body></worldbody></mujoco>"
    )
    (tmp_path / "main.xml").write_text(text)
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "main.xml"))
    found = import_robot(tmp_path / "main.xml")
    assert found.robot.mass == pytest.approx(compiled.body_subtreemass[1], rel=1e-12)
    assert values(found)[0] == 9.0
    assert values(found)[2] == 0.4
    assert found.robot.wheel.rotor_inertia == 0.002
    assert "a_wheel, b_wheel, c_wheel" in found.guessed[0]
    rows = np.array(found.robot.mounts)[:, :2]
    assert rows == pytest.approx(np.array(list(WHEELS.values()))[:, :2], abs=1e-9)
    (tmp_path / "wheel.xml").unlink()
    with pytest.raises(InvalidRobot, match=r"<model>: there is no file 'wheel\.xml'"):
        import_robot(tmp_path / "main.xml")


def test_replicated_wheels_are_read(tmp_path):
    wheel = (
        '<body name="wheel" pos="0.1 0 0.05"><joint name="wheel" axis="1 0 0"/>'
        '<geom size="0.05" mass="0.2"/></body>'
    )
    (tmp_path / "a.xml").write_text(
        '<mujoco><worldbody><body name="base"><freejoint/><geom size="0.1" mass="3"/>'
        f'<replicate count="3" euler="0 0 120">{wheel}</replicate></body></worldbody></mujoco>'
    )
    robot = import_robot(tmp_path / "a.xml").robot
    distances = np.hypot(*np.array([(m.x, m.y) for m in robot.mounts]).T)
    assert distances == pytest.approx(np.full(3, 0.1))


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ('<include file="../outside.xml"/>', "<include> is not supported outside the folder"),
        ('<include file="link.xml"/>', "<include> is not supported outside the folder"),
        ('<include file="/etc/passwd"/>', "<include> is not supported outside the folder"),
        ('<include file="none.xml"/>', "<include>: there is no file 'none.xml'"),
        ('<include file="a.xml"/>', "<include>: 'a.xml' contains itself"),
        ('<include file="b.xml"/>', "<include>: 'b.xml' contains itself"),
        ('<include file="sdf.xml"/>', "<include>: sdf.xml is no MJCF"),
        ('<include file="bad.xml"/>', r"bad\.xml: line 1, column \d+: not XML"),
        ("<include/>", "include: expected the attribute file"),
        ('<asset><model name="m" file="a.xml"/></asset>', "<model>: 'a.xml' contains itself"),
        ('<replicate count="30000"><body/></replicate>', "<replicate> is not supported beyond 200"),
        ('<worldbody><replicate count="200"><replicate count="200"><body/></replicate></replicate>'
         "</worldbody>", "<replicate> is not supported beyond 20000 elements"),
        ('<worldbody><replicate count="1e9"><body/></replicate></worldbody>', "<replicate> is not"),
        ('<worldbody><body><composite type="cable" count="9 1 1"/></body></worldbody>',
         "<composite> is not supported; remove it, or save the compiled model"),
        ('<worldbody><body><wing mass="3"/></body></worldbody>', "MuJoCo: .*wing"),
        ("<motors/>", "MuJoCo: .*motors"),
        ('<worldbody><geom type="torus"/></worldbody>', "MuJoCo: .*torus"),
        ('<actuator><motor joint="none"/></actuator>', "MuJoCo: .*none"),
    ],
)  # fmt: skip
def test_other_parts_are_refused_with_one_sentence(tmp_path, part, message):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "outside.xml").write_text("<mujocoinclude/>")
    (folder / "link.xml").symlink_to(tmp_path / "outside.xml")
    (folder / "b.xml").write_text('<mujocoinclude><include file="b.xml"/></mujocoinclude>')
    (folder / "sdf.xml").write_text("<sdf/>")
    (folder / "bad.xml").write_text("<mujocoinclude>")
    (folder / "a.xml").write_text(model().replace("<worldbody>", f"{part}<worldbody>", 1))
    with pytest.raises(InvalidRobot, match=message) as caught:
        import_robot(folder / "a.xml")
    assert "\n" not in str(caught.value)
