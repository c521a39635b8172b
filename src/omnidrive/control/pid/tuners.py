"""Fuzzy systems that tune gains: the paper's text, and what its published code used."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal

from omnidrive.control.pid.channel import Tuner
from omnidrive.control.pid.rules import paper_rules, published_rules
from omnidrive.control.pid.sets import Footprint
from omnidrive.control.pid.type1 import (
    ExactType1,
    GainChange,
    SampledType1,
    exact_type1,
    sampled_type1,
)
from omnidrive.control.pid.type2 import (
    CentreOfSetsType2,
    CentroidType2,
    centre_of_sets_type2,
    centroid_type2,
)
from omnidrive.errors import InvalidInput

Kind = Literal["t1", "t2"]
Preset = Literal["paper", "published-code"]

PAPER_FOOTPRINT = Footprint(scale=1.0, lag=0.3)
"""Of every set, in the paper's text."""
PUBLISHED_INPUTS = Footprint(scale=0.7, lag=0.2)
"""Of the input sets, in the published code."""
PUBLISHED_OUTPUTS = Footprint(scale=1.0, lag=0.2)
"""Of the output sets, in the published code: Matlab's default."""


def _middle(
    infer: Callable[[float, float], tuple[GainChange, GainChange]], error: float, change: float
) -> GainChange:
    least, greatest = infer(error, change)
    return (
        0.5 * (least[0] + greatest[0]),
        0.5 * (least[1] + greatest[1]),
        0.5 * (least[2] + greatest[2]),
    )


def _paper_t1() -> Tuner:
    return partial(exact_type1, ExactType1.of(paper_rules()))


def _paper_t2() -> Tuner:
    system = CentreOfSetsType2.of(paper_rules(), PAPER_FOOTPRINT, PAPER_FOOTPRINT)
    return partial(_middle, partial(centre_of_sets_type2, system))


def _published_t1() -> Tuner:
    return partial(sampled_type1, SampledType1.of(published_rules()))


def _published_t2() -> Tuner:
    system = CentroidType2.of(published_rules(), PUBLISHED_INPUTS, PUBLISHED_OUTPUTS)
    return partial(_middle, partial(centroid_type2, system))


_TUNERS: dict[tuple[Preset, Kind], Callable[[], Tuner]] = {
    ("paper", "t1"): _paper_t1,
    ("paper", "t2"): _paper_t2,
    ("published-code", "t1"): _published_t1,
    ("published-code", "t2"): _published_t2,
}


def fuzzy_tuner(kind: Kind, preset: Preset) -> Tuner:
    """The fuzzy system of a preset: from scaled error and change to changes of kp, ki and kd.

    Inputs outside [-1, 1] fire no rule: the changes are then zero.

    Raises:
        InvalidInput: There is no such kind or preset.
    """
    if (preset, kind) not in _TUNERS:
        known = ", ".join(f"{k} of {p}" for p, k in _TUNERS)
        raise InvalidInput(f"there is no fuzzy system {kind} of {preset}; there are {known}")
    return _TUNERS[preset, kind]()
