"""How a self-tuning controller's gains moved, found in a run's log."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.simulation import Run

GAINS = ("kp", "ki", "kd")
INPUTS = {"error_input": "scaled error", "change_input": "scaled change of error"}
"""What the fuzzy system sees, and what to call it."""


class TuningSignal(NamedTuple):
    """One gain or input of one channel over time, a :attr:`Run.details` column."""

    quantity: str
    """One of :data:`GAINS` or :data:`INPUTS`."""
    channel: str
    """Which error it belongs to: position, x, y or heading."""
    unit: str
    values: Float[Array, " rows"]
    """At each sample; NaN in the last row, which has no command."""


def unit_text(unit: str) -> str:
    """A unit as it is printed; empty for a number without one."""
    return "" if unit == "1" else unit.replace("^2", "²")


def tuning_signals(run: Run) -> list[TuningSignal]:
    """Every gain, and every input that a tuner sees: constant gains have none."""
    found = [
        TuningSignal(quantity, name.removeprefix(f"{quantity}_"), run.detail_units[name], column)
        for name, column in run.details.items()
        for quantity in (*GAINS, *INPUTS)
        if name.startswith(f"{quantity}_") and np.isfinite(column).any()
    ]
    moving = {each.channel for each in found if each.quantity in GAINS and _moves(each.values)}
    return [each for each in found if each.quantity in GAINS or each.channel in moving]


def _moves(values: Float[Array, " rows"]) -> bool:
    return bool(np.nanmax(values) > np.nanmin(values))
