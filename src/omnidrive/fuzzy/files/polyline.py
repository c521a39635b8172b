"""Shapes that points draw."""

from __future__ import annotations

from omnidrive.fuzzy.membership import Membership

CORNERS: dict[str, tuple[float, ...]] = {
    "trimf": (0.0, 1.0, 0.0),
    "trapmf": (0.0, 1.0, 1.0, 0.0),
    "linsmf": (0.0, 1.0),
    "linzmf": (1.0, 0.0),
}
"""Degrees at the corners of each shape."""


def simplest(function: Membership) -> Membership:
    """The same function as a triangle, trapezoid or ramp, if it is a ``pointsmf`` that is one.

    A point at either end that only continues the constant beyond it may be there or not.
    """
    if function.shape != "pointsmf":
        return function
    x, y = function.parameters[::2], function.parameters[1::2]
    first, last = 0, len(x)
    while last - first > 1 and y[first] == y[first + 1]:
        first += 1
    while last - first > 1 and y[last - 1] == y[last - 2]:
        last -= 1
    x, y = x[first:last], y[first:last]
    for shape, degrees in CORNERS.items():
        if y == degrees and (len(y) == 2 or x[0] < x[-1]):
            return Membership(shape, x)
    return function
