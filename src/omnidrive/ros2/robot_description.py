"""A robot as URDF, the text on the topic ``/robot_description``."""

from __future__ import annotations

from math import pi
from xml.sax.saxutils import quoteattr

from omnidrive.robot import Robot


def wheel_joints(robot: Robot) -> tuple[str, ...]:
    """Return the names of the joints of the wheels, in the order of ``robot.mounts``."""
    return tuple(f"wheel_{i}_joint" for i in range(len(robot.mounts)))


def robot_description(robot: Robot, *, base: str = "base_link") -> str:
    """Return a robot as URDF: a disc, and wheels on hinges (http://wiki.ros.org/urdf/XML).

    The link of the base is the frame B, at the height of the axles. A hinge turns in the positive
    sense when the wheel rolls along its drive direction. Rollers are no part of it.

    Args:
        robot: The robot.
        base: Name of the link of the base.
    """
    wheel = robot.wheel
    height = max(2.0 * (robot.com_height - wheel.radius), wheel.radius)
    yaw = robot.frame_inertia
    frame = _inertial(robot.frame_mass, (0.5 * yaw, 0.5 * yaw, yaw), robot.frame_com)
    parts = [
        f'<?xml version="1.0"?>\n<robot name={quoteattr(robot.name)}>',
        f"  <link name={quoteattr(base)}>",
        f"    {frame}",
        *_cylinder(robot.body_radius, height),
        "  </link>",
    ]
    spin = wheel.hub_inertia + wheel.rotor_inertia
    width = wheel.rows * wheel.row_gap
    for i, (mount, joint) in enumerate(zip(robot.mounts, wheel_joints(robot), strict=True)):
        parts += [
            f'  <link name="wheel_{i}">',
            f"    {_inertial(wheel.total_mass, (0.5 * spin, 0.5 * spin, spin))}",
            *_cylinder(wheel.radius, width),
            "  </link>",
            f'  <joint name="{joint}" type="continuous">',
            f'    <parent link={quoteattr(base)}/><child link="wheel_{i}"/>',
            f'    <origin xyz="{mount.x:.9g} {mount.y:.9g} 0" '
            f'rpy="{-0.5 * pi:.17g} 0 {mount.axle_angle + 0.5 * pi:.17g}"/>',
            '    <axis xyz="0 0 1"/>',
            f'    <limit effort="{robot.max_torque:.9g}" velocity="{robot.max_wheel_speed:.9g}"/>',
            "  </joint>",
        ]
    return "\n".join([*parts, "</robot>", ""])


def _inertial(
    mass: float, inertia: tuple[float, float, float], at: tuple[float, float] = (0.0, 0.0)
) -> str:
    xx, yy, zz = inertia
    return (
        f'<inertial><origin xyz="{at[0]:.9g} {at[1]:.9g} 0"/><mass value="{mass:.9g}"/>'
        f'<inertia ixx="{xx:.9g}" ixy="0" ixz="0" iyy="{yy:.9g}" iyz="0" izz="{zz:.9g}"/>'
        "</inertial>"
    )


def _cylinder(radius: float, length: float) -> list[str]:
    shape = f'<geometry><cylinder radius="{radius:.9g}" length="{length:.9g}"/></geometry>'
    return [f"    <visual>{shape}</visual>", f"    <collision>{shape}</collision>"]
