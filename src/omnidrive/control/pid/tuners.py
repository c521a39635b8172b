"""Fuzzy systems that tune gains: those of the paper's text and of its published code."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import isfinite, nan
from typing import Literal, get_args

from omnidrive.control.pid.gain_tuning import gain_tuning_system
from omnidrive.control.pid.laws import GainChange
from omnidrive.control.pid.rules import paper_rules, published_rules
from omnidrive.fuzzy import Footprint, FuzzySystem, Inference, Secondary
from omnidrive.parameter import check_choice

Kind = Literal["t1", "t2", "t3"]
Preset = Literal["paper", "published-code"]

PAPER_FOOTPRINT = Footprint(scale=1.0, left=0.3)
"""Footprint of every set in the paper's text."""
PUBLISHED_INPUTS = Footprint(scale=0.7, left=0.2)
"""Footprint of the input sets in the published code."""
PUBLISHED_OUTPUTS = Footprint(scale=1.0, left=0.2)
"""Footprint of the output sets in the published code: Matlab's default."""

SLICES = 5
"""Number of levels of the z-slices of type-3 sets.

Twice as many change no output by 1e-4, 1/2000 of its range."""


@cache
def gain_inference(kind: Kind, preset: Preset) -> Inference:
    """Return the compiled fuzzy system of a preset.

    ``paper`` has the paper's table, exact centroids and, for types 2 and 3, centre-of-sets type
    reduction; ``published-code`` has the code's table and Matlab's centroid. The paper has no
    type 3: its sets are those of type 2 with the default secondary membership.

    Raises:
        InvalidInput: The kind or preset is unknown.
    """
    check_choice("preset", preset, get_args(Preset))
    check_choice("kind of fuzzy system", kind, get_args(Kind))
    return _paper(kind) if preset == "paper" else _published(kind)


@dataclass(frozen=True, eq=False, slots=True)
class FuzzyTuner:
    """A :data:`~omnidrive.control.pid.Tuner` that evaluates a fuzzy system.

    Attributes:
        inference: The compiled system; its outputs are the changes of kp, ki and kd.
    """

    inference: Inference

    def __call__(self, error: float, change: float) -> GainChange:
        """Return the changes; nan for inputs that are not finite, which fails the step."""
        if not (isfinite(error) and isfinite(change)):
            return nan, nan, nan
        kp, ki, kd = self.inference(error, change).tolist()
        return kp, ki, kd


def fuzzy_tuner(kind: Kind, preset: Preset) -> FuzzyTuner:
    """Return the tuner of a preset: from scaled error and change to the changes of kp, ki and kd.

    Inputs outside [-1, 1] fire no rule, as in Matlab: the changes are then zero. Inputs that are
    not finite give nan.

    Raises:
        InvalidInput: The kind or preset is unknown.
    """
    return FuzzyTuner(gain_inference(kind, preset))


def _paper(kind: Kind) -> Inference:
    system = gain_tuning_system(paper_rules())
    if kind == "t1":
        return Inference(system, out_of_range="matlab")
    uncertain = _uncertain(kind, system, PAPER_FOOTPRINT, PAPER_FOOTPRINT)
    return Inference(uncertain, reduction="cos", out_of_range="matlab", slices=SLICES)


def _published(kind: Kind) -> Inference:
    system = gain_tuning_system(published_rules())
    if kind != "t1":
        system = _uncertain(kind, system, PUBLISHED_INPUTS, PUBLISHED_OUTPUTS)
    return Inference(system, centroid="matlab", out_of_range="matlab", slices=SLICES)


def _uncertain(
    kind: Kind, system: FuzzySystem, inputs: Footprint, outputs: Footprint
) -> FuzzySystem:
    return system.with_footprint(inputs, outputs, Secondary() if kind == "t3" else None)
