"""Fuzzy systems that tune gains: the paper's text, and what its published code used."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from math import isfinite, nan
from typing import Literal

from omnidrive.control.pid.channel import Tuner
from omnidrive.control.pid.gain_tuning import gain_tuning_system
from omnidrive.control.pid.laws import GainChange
from omnidrive.control.pid.rules import paper_rules, published_rules
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy import Footprint, FuzzySystem, Inference, Secondary

Kind = Literal["t1", "t2", "t3"]
Preset = Literal["paper", "published-code"]

PAPER_FOOTPRINT = Footprint(scale=1.0, left=0.3)
"""Of every set, in the paper's text."""
PUBLISHED_INPUTS = Footprint(scale=0.7, left=0.2)
"""Of the input sets, in the published code."""
PUBLISHED_OUTPUTS = Footprint(scale=1.0, left=0.2)
"""Of the output sets, in the published code: Matlab's default."""

SLICES = 5
"""Levels at which sets of type 3 are cut: twice as many change no output by 1e-4, 1/2000 of its
range."""


@cache
def gain_inference(kind: Kind, preset: Preset) -> Inference:
    """The fuzzy system of a preset, ready to be evaluated.

    ``paper`` has the paper's table, exact centroids and, for type 2 and 3, centre of sets;
    ``published-code`` has the code's table and Matlab's centroid. The paper has no type 3: its
    sets are those of type 2 with the usual secondary function.

    Raises:
        InvalidInput: There is no such kind or preset.
    """
    makers: dict[str, Callable[[Kind], Inference]] = {"paper": _paper, "published-code": _published}
    if preset not in makers or kind not in {"t1", "t2", "t3"}:
        known = ", ".join(f"{k} of {p}" for p in makers for k in ("t1", "t2", "t3"))
        raise InvalidInput(f"there is no fuzzy system {kind} of {preset}; there are {known}")
    return makers[preset](kind)


def fuzzy_tuner(kind: Kind, preset: Preset) -> Tuner:
    """The fuzzy system of a preset: from scaled error and change to changes of kp, ki and kd.

    Inputs outside [-1, 1] fire no rule, as in Matlab: the changes are then zero.

    Raises:
        InvalidInput: There is no such kind or preset.
    """
    return partial(_changes, gain_inference(kind, preset))


def _changes(infer: Inference, error: float, change: float) -> GainChange:
    if not (isfinite(error) and isfinite(change)):
        return nan, nan, nan  # a lost measurement: the loop stops the robot, nothing is raised
    kp, ki, kd = infer(error, change).tolist()
    return kp, ki, kd


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
