"""Small drawing of the fuzzy sets of a variable for notebooks."""

from __future__ import annotations

import numpy as np

from omnidrive.fuzzy.sets import membership_bounds
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction, Variable
from omnidrive.notebook import BLUE, ORANGE, Drawing

_SAMPLES = 101
_MOST_SETS = 12


def sets_svg(variable: Variable) -> str:
    """Return the membership functions of a variable with their footprints; empty without sets.

    At most 12 sets are drawn. Constants of a Sugeno output are drawn as vertical lines.
    """
    functions = [each for each in variable.sets[:_MOST_SETS] if isinstance(each, LinearFunction)]
    sets = [each for each in variable.sets[:_MOST_SETS] if isinstance(each, FuzzySet)]
    constants = [each.constant for each in functions if not any(each.coefficients)]
    if not sets and not constants:
        return ""
    low, high = min([variable.low, *constants]), max([variable.high, *constants])
    drawing = Drawing((low, high, 0.0, 1.0), width=180.0, height=48.0)
    drawing.line(np.array([[low, 0.0], [high, 0.0]]), width=0.5)
    for constant in constants:
        drawing.line(np.array([[constant, 0.0], [constant, 1.0]]), ORANGE)
    at = np.linspace(low, high, _SAMPLES)
    for each, below, above in zip(sets, *membership_bounds(sets, at), strict=True):
        if each.lower is not None:
            around = np.vstack([np.column_stack([at, below]), np.column_stack([at, above])[::-1]])
            drawing.polygon(around, BLUE, opacity=0.3)
        drawing.line(np.column_stack([at, above]), BLUE, width=1.0)
    return drawing.svg()
