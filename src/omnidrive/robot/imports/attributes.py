"""Numbers in the attributes of robot descriptions in XML."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidRobot, short_repr
from omnidrive.files.number_text import parse_number
from omnidrive.files.position import Position
from omnidrive.files.xml_elements import Element
from omnidrive.robot.robot_file import MAX_NUMBER


def malformed(position: Position, what: str) -> InvalidRobot:
    """Return an error that names a position in a text."""
    return InvalidRobot(f"line {position.line}, column {position.column}: {what}")


def words(root: Element) -> str:
    """Return the texts and the values of all attributes of a description, one per line."""
    return "\n".join(
        text for each in root.walk() for text in (each.text, *each.attributes.values())
    )


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
    found = [value for value in values if value is not None and abs(value) <= MAX_NUMBER]
    if len(values) != count or len(found) != count:
        raise malformed(
            element.position,
            f"{element.tag[:40]}: {name} needs {count} finite number{'s' if count > 1 else ''}, "
            f"got {short_repr(text)}",
        )
    return np.array(found)


def number(element: Element, name: str, default: float | None = None) -> float:
    """Return the number of an attribute; see :func:`numbers`."""
    return float(numbers(element, name, 1, None if default is None else (default,))[0])


def positive_or_zero(element: Element, name: str, default: float | None = None) -> float:
    """Return the number of an attribute; raise InvalidRobot if it is negative."""
    value = number(element, name, default)
    if value < 0.0:
        raise malformed(
            element.position, f"{element.tag[:40]}: {name} must not be negative, got {value:g}"
        )
    return value


def direction(
    element: Element, name: str, default: tuple[float, ...] | None = None
) -> Float[Array, " 3"]:
    """Return the unit vector along the vector of an attribute; raise InvalidRobot if it is zero."""
    vector = numbers(element, name, 3, default)
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise malformed(element.position, "the axis of a joint is zero")
    return vector / length
