"""Rule tables: the changes of the gains for each pair of error and error change."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from omnidrive.arrays import Array

LABELS = ("NB", "NM", "NS", "ZO", "PS", "PM", "PB")
"""Names of the seven sets of every variable, from negative big to positive big."""

# Rows: error. Columns: error change, NB to PB. Cells: change of kp/ki/kd.
_PAPER = {
    "NB": "PB/NB/PS PB/NB/NS PM/NM/NB PM/NM/NB PS/NS/NB ZO/ZO/NM ZO/ZO/PS",
    "NM": "PB/NB/PS PB/NB/NS PM/NM/NB PS/NS/NM PS/NS/NM ZO/ZO/NS NS/ZO/ZO",
    "NS": "PM/NB/ZO PM/NM/NM PM/NS/NM PS/NS/NM ZO/ZO/NS NS/PS/NS NS/PS/ZO",
    "ZO": "PM/NM/ZO PM/NM/NS PS/NS/NS ZO/ZO/NS NS/PS/NS NM/PM/NS NM/PM/ZO",
    "PS": "PS/NM/ZO PS/NS/ZO ZO/ZO/ZO NS/PS/ZO NS/PS/ZO NM/PM/ZO NM/PB/ZO",
    "PM": "PS/ZO/PB ZO/ZO/NS NS/PS/PS NM/PS/PS NM/PM/PS NM/PB/PS NB/PB/PB",
    "PB": "ZO/ZO/PB ZO/ZO/PM NM/PS/PM NM/PM/PM NM/PM/PS NB/PB/PS NB/PB/PB",
}

# The two cells in which the published system differs from the paper's table: (row, column).
_PUBLISHED_CELLS = {("NS", "NM"): "PM/NM/NS", ("PS", "NM"): "NS/ZO/ZO"}


def _consequents(cell: str) -> list[int]:
    return [LABELS.index(label) for label in cell.split("/")]


def paper_rules() -> Int[Array, "7 7 3"]:
    """Return the rule table of the paper's text, as indices into :data:`LABELS`.

    The element (i, j, g) is the consequent for gain g (kp, ki, kd) if the error is set i and the
    error change set j.
    """
    return np.array([[_consequents(cell) for cell in _PAPER[row].split()] for row in LABELS])


def published_rules() -> Int[Array, "7 7 3"]:
    """Return the rule table of the published system: :func:`paper_rules` except for two cells."""
    rules = paper_rules()
    for (row, column), cell in _PUBLISHED_CELLS.items():
        rules[LABELS.index(row), LABELS.index(column)] = _consequents(cell)
    return rules
