"""Elements and attributes of MJCF, MuJoCo's model format, that several modules use."""

from __future__ import annotations

from math import cos, sin
from xml.etree import ElementTree as ET

from omnidrive.robot import Robot

CONTACT = {"condim": "3", "solref": "0.005 1", "solimp": "0.95 0.99 0.0005"}
"""Contact parameters of wheels and floor."""
VISUAL = {"contype": "0", "conaffinity": "0", "mass": "0", "group": "1"}
"""Attributes of geoms that are drawn but have neither mass nor contacts."""


def add(parent: ET.Element, tag: str, **attributes: object) -> ET.Element:
    """Append a new element to ``parent`` and return it."""
    return ET.SubElement(parent, tag, {k: str(v) for k, v in attributes.items()})


def numbers(*values: float) -> str:
    """Format numbers as an MJCF attribute, with nine significant digits."""
    return " ".join(f"{v:.9g}" for v in values)


def yaw_quaternion(angle: float) -> str:
    """Format the quaternion of a rotation by ``angle`` (rad) about z."""
    return numbers(cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle))


def floor_friction(robot: Robot) -> str:
    """Format the friction of floor and tyres; condim 3 uses the first number only."""
    return numbers(robot.friction, 0.0005, 0.0001)
