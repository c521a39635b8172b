"""Outline of a robot seen from above."""

from __future__ import annotations

from json import loads
from typing import Any

import numpy as np

from omnidrive.errors import InvalidInput, short_repr
from omnidrive.geometry.polygon import Polygon
from omnidrive.robot.checks import check_no_faults

Outline = tuple[tuple[float, float], ...]
"""Corners (x, y) of a simple polygon in B, in m, in either order."""

_ROUNDING = 1e-9
"""Relative excess of the outline over the circle that is rounding error."""


def outline_faults(outline: Outline, body_radius: float | None) -> list[str]:
    """Return the fault of an outline in a list, empty if it has none.

    Args:
        outline: Corners (x, y) in B, in m.
        body_radius: Radius of the circle around the robot, in m; None: any.
    """
    try:
        polygon = Polygon.of(np.array(outline, float))
    except (InvalidInput, TypeError, ValueError) as error:
        fact = error if isinstance(error, InvalidInput) else "its corners must be pairs of numbers"
        return [f"the robot's outline: {fact}"]
    if not polygon.contains(np.zeros(2)):
        return ["the robot's outline must contain the origin of B, the centre of the robot"]
    if body_radius is not None and polygon.radius > body_radius * (1.0 + _ROUNDING):
        return [
            f"the robot's outline reaches {polygon.radius:.4g} m from the centre, beyond "
            f"body_radius {body_radius:g} m: raise body_radius, or omit it to derive it"
        ]
    return []


def outline_of(value: Any) -> Any:
    """Return the corners that a text of the form of Nav2 denotes; other values are unchanged.

    Nav2 writes the parameter ``footprint`` as a text such as ``"[[0.3, 0.2], [-0.3, 0.2], ...]"``
    (nav2_costmap_2d).

    Raises:
        ValueError: The text has another form.
    """
    if not isinstance(value, str):
        return value
    try:
        return loads(value)
    except (ValueError, RecursionError):
        raise ValueError(
            f"needs corners such as [[0.3, 0.2], ...], in m, got {short_repr(value)}"
        ) from None


def outline_radius(outline: Outline) -> float:
    """Return the radius in m of the circle about the origin of B through the farthest corner.

    Raises:
        InvalidInput: The outline has a fault, see :func:`outline_faults`.
    """
    check_no_faults(outline_faults(outline, None))
    return Polygon.of(np.array(outline, float)).radius
