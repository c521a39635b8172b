"""Small drawing of the fuzzy sets of a variable for notebooks."""

from __future__ import annotations

import numpy as np

from omnidrive.fuzzy.sets import membership_bounds
from omnidrive.fuzzy.variables import FuzzySet, LinearFunction, Variable
from omnidrive.notebook import BLUE, ORANGE, Drawing

_SAMPLES = 101
_MAX_SETS = 12


def sets_svg(variable: Variable) -> str:
    """Return the membership functions of a variable with their footprints; empty without sets.

    At most 12 sets are drawn. Constants of a Sugeno output are drawn as vertical lines.
    """
    functions = [each for each in variable.sets[:_MAX_SETS] if isinstance(each, LinearFunction)]
    sets = [each for each in variable.sets[:_MAX_SETS] if isinstance(each, FuzzySet)]
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
        support = np.convolve(above > 0.0, np.ones(3), "same") > 0.0  # and one point beside it
        low_side, high_side = (np.column_stack([at, y])[support] for y in (below, above))
        if each.lower is not None:
            drawing.polygon(np.vstack([low_side, high_side[::-1]]), BLUE, opacity=0.3)
        drawing.line(high_side, BLUE, width=1.0)
    return drawing.svg()
