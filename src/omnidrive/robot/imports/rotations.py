"""Rotation matrices and numbers of robot descriptions in XML."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidRobot
from omnidrive.files.bounded_file import short_repr
from omnidrive.files.number_text import parse_number
from omnidrive.files.position import Position
from omnidrive.files.xml_elements import Element

_MAX_NUMBER = 1e9  # in SI units

Matrix = Float[Array, "3 3"]


def malformed(position: Position, what: str) -> InvalidRobot:
    """Return an error that names a position in a text."""
    return InvalidRobot(f"line {position.line}, column {position.column}: {what}")


def numbers(
    element: Element, name: str, count: int, default: tuple[float, ...] | None = None
) -> Float[Array, " count"]:
    """Return the numbers of an attribute.

    Args:
        element: The element.
        name: Name of the attribute.
        count: How many numbers it holds.
        default: Numbers if there is no such attribute; None: it is required.

    Raises:
        InvalidRobot: The attribute is missing, or does not hold ``count`` finite numbers.
    """
    if name not in element.attributes and default is not None:
        return np.array(default)
    text = element.get(name)
    values = [parse_number(word) for word in text.split()[: count + 1]]
    found = [value for value in values if value is not None and abs(value) <= _MAX_NUMBER]
    if len(values) != count or len(found) != count:
        hint = "; expand the file by xacro first" if "${" in text else ""
        raise malformed(
            element.position,
            f"{element.tag[:40]}: {name} needs {count} finite number{'s' if count > 1 else ''}, "
            f"got {short_repr(text)}{hint}",
        )
    return np.array(found)


def number(element: Element, name: str, default: float | None = None) -> float:
    """Return the number of an attribute; see :func:`numbers`."""
    return float(numbers(element, name, 1, None if default is None else (default,))[0])


def about(axis: int, angle: float) -> Matrix:
    """Return the rotation about x (0), y (1) or z (2) by ``angle``, rad."""
    c, s = cos(angle), sin(angle)
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def from_quaternion(w: float, x: float, y: float, z: float) -> Matrix:
    """Return the rotation of a quaternion, which need not have the length 1."""
    norm = w * w + x * x + y * y + z * z
    if not norm > 0.0:
        return np.eye(3)
    s = 2.0 / norm
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
        ]
    )


def from_z(direction: Float[Array, " 3"]) -> Matrix:
    """Return the smallest rotation that turns z towards ``direction``."""
    length = float(np.linalg.norm(direction))
    x, y, z = direction / length if length > 0.0 else (0.0, 0.0, 1.0)
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    return from_quaternion(1.0 + z, -y, x, 0.0)
