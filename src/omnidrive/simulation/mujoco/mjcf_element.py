"""Elements of MJCF, and how numbers stand in them."""

from __future__ import annotations

from math import cos, sin
from xml.etree import ElementTree as ET


def add(parent: ET.Element, tag: str, **attributes: object) -> ET.Element:
    """A new child of ``parent``."""
    return ET.SubElement(parent, tag, {k: str(v) for k, v in attributes.items()})


def numbers(*values: float) -> str:
    """Numbers as MJCF has them, to nine digits."""
    return " ".join(f"{v:.9g}" for v in values)


def about_z(angle: float) -> str:
    """Quaternion of a turn by ``angle`` rad."""
    return numbers(cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle))
