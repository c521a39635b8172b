"""Gains and fuzzy inputs of a self-tuning controller, read from the log of a run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.simulation import Run

GAINS = ("kp", "ki", "kd")
INPUTS = {"error_input": "scaled error", "change_input": "scaled change of error"}
"""Inputs of the fuzzy system, with their display names."""


class TuningSignal(NamedTuple):
    """Time series of one gain or fuzzy input of one channel, a column of :attr:`Run.details`."""

    quantity: str
    """One of :data:`GAINS` or :data:`INPUTS`."""
    channel: str
    """Controlled error: position, x, y or heading."""
    unit: str
    values: Float[Array, " rows"]
    """Value at each sample; NaN in the last row, which has no command."""


def unit_text(unit: str) -> str:
    """Format a unit for display; empty for a dimensionless quantity."""
    return "" if unit == "1" else unit.replace("^2", "²")


def tuning_signals(run: Run) -> list[TuningSignal]:
    """Return every logged gain, and the fuzzy inputs of every channel whose gains vary."""
    found = [
        TuningSignal(quantity, name.removeprefix(f"{quantity}_"), run.detail_units[name], column)
        for name, column in run.details.items()
        for quantity in (*GAINS, *INPUTS)
        if name.startswith(f"{quantity}_") and np.isfinite(column).any()
    ]
    varying = {each.channel for each in found if each.quantity in GAINS and _varies(each.values)}
    return [each for each in found if each.quantity in GAINS or each.channel in varying]


def _varies(values: Float[Array, " rows"]) -> bool:
    return bool(np.nanmax(values) > np.nanmin(values))
