"""Descriptions that xacro has not expanded, and elements that are not those of URDF."""

import pytest

from omnidrive.errors import InvalidRobot
from omnidrive.robot.imports import import_robot
from tests.robot.descriptions import mecanum_urdf
from tests.shared_data import shared

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
MECANUM = mecanum_urdf().replace("my_base", "my_mecanum_base")


@pytest.fixture
def imported(tmp_path):
    """Import a text as a file of a name."""

    def load(text, name="cart.urdf.xacro"):
        (tmp_path / name).write_text(text)
        return import_robot(tmp_path / name)

    return load


@pytest.mark.parametrize("file", ["cart.urdf.xacro", "empty.urdf.xacro"])
def test_files_with_elements_of_xacro_are_refused(file):
    target = file.removesuffix(".xacro")
    with pytest.raises(
        InvalidRobot, match=f"expand the file by xacro first: xacro {file} > {target}"
    ):
        import_robot(shared(f"cases/02-xacro-silently-dropped/{file}"))


def test_the_expanded_file_gives_the_robot():
    robot = import_robot(shared("cases/02-xacro-silently-dropped/cart.urdf")).robot
    assert robot.mass == 22.0
    assert robot.com[0] == pytest.approx(12 * -0.1 / 22)
    assert robot.body_inertia == pytest.approx(0.348)


def within(text):
    """Insert a text at the end of a robot with the namespace of xacro."""
    robot = MECANUM.replace("<robot ", f"<robot {XACRO} ")
    return robot.replace("</robot>", f"{text}</robot>")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (within('<xacro:battery m="12"/>'), "<xacro:battery> is xacro"),
        (within('<xacro:include filename="a.xacro"/>'), "<xacro:include> is xacro"),
        (within('<xacro:if value="1"><link name="b"/></xacro:if>'), "<xacro:if> is xacro"),
        (within('<xacro:property name="a" value="1"/>'), "<xacro:property> is xacro"),
        (within('<xacro:link name="b"/>'), "<xacro:link> is xacro"),
        (within('<xacro:joint name="b"/>'), "<xacro:joint> is xacro"),
        (within('<gazebo><xacro:plugin/></gazebo>'), "<xacro:plugin> is xacro"),
        (within('<gazebo xacro:if="1"/>'), "gazebo: xacro:if is xacro"),
        (within('<x:battery xmlns:x="http://wiki.ros.org/xacro"/>'), "<x:battery> is xacro"),
        (MECANUM.replace('"base_link"', '"$(arg prefix)_base_link"'), r"\$\(arg prefix\) is xacro"),
        (MECANUM.replace("front_left", "${ns}front_left"), r"\$\{ns\} is xacro"),
        (MECANUM.replace("package://", "$(find pkg)/"), r"mesh: \$\(find pkg\) is xacro"),
        (MECANUM.replace('value="17.6"', 'value="${m}"'), r"mass: \$\{m\} is xacro"),
        (within("<gazebo><a>$(eval 1 + 2)</a></gazebo>"), r"a: \$\(eval 1 \+ 2\) is xacro"),
        ("<xacro:thing/>", "<xacro:thing> is xacro"),
        (f'<robot {XACRO}><xacro:base name="b"/></robot>', "<xacro:base> is xacro"),
    ],
)  # fmt: skip
def test_unexpanded_xacro_is_refused_with_the_command(imported, text, found):
    with pytest.raises(
        InvalidRobot, match=f"{found}; expand the file by xacro first: xacro cart.u"
    ):
        imported(text)


def test_a_declaration_of_the_namespace_and_dollars_are_no_xacro(imported):
    text = within("<gazebo><a>price: $5, $${x}, $(other)</a></gazebo>")
    assert imported(text).robot == imported(MECANUM).robot


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (within('<group><link name="b"><inertial/></link></group>'), "<group> .*holds <link>"),
        (within('<old:link name="b"/>'), "<old:link> is no element of URDF here, but holds <old:l"),
        (within('<body name="b"><mass value="3"/></body>'), "<body> is no element of URDF here"),
        (within('<motor joint="b"/>'), "<motor> is no element of URDF here"),
        (MECANUM.replace("<inertial>", "<part><inertial>", 1).replace(
            "</inertial>", "</inertial></part>", 1), "<part> is no element of .* holds <inertial>"),
        (within('<link name="base_link"/>'), "there are two links 'base_link'"),
        (within('<joint name="b"/>'), "joint: expected the attribute type"),
    ],
)  # fmt: skip
def test_parts_of_a_mechanism_in_unknown_elements_are_refused(imported, text, message):
    with pytest.raises(InvalidRobot, match=message):
        imported(text, "cart.urdf")


def test_other_unknown_elements_are_named_in_a_warning(imported):
    found = imported(within('<battery m="12"/><battery m="3"/><drake:hint/>'), "cart.urdf")
    assert found.warnings == (
        "elements that URDF does not define are not read: <battery>, <drake:hint>",
    )
