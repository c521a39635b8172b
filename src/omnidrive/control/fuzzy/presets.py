"""Named fuzzy PID controllers: the paper's text, and what its published code did."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import isfinite
from typing import Literal

from omnidrive.control.fuzzy.channel import MemorylessChannel, SelfTuningChannel, Tuner
from omnidrive.control.fuzzy.controller import FuzzyPidController
from omnidrive.control.fuzzy.pid import MemorylessParameters, SelfTuningParameters
from omnidrive.control.fuzzy.rules import paper_rules, published_rules
from omnidrive.control.fuzzy.sets import Footprint
from omnidrive.control.fuzzy.type1 import (
    ExactType1,
    GainChange,
    SampledType1,
    exact_type1,
    sampled_type1,
)
from omnidrive.control.fuzzy.type2 import (
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

MAX_YAW_RATE = 3.14
"""Limit of the paper's predictive controller, in rad/s."""


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


def fuzzy_pid(kind: Kind, preset: Preset, dt: float) -> FuzzyPidController:
    """Self-tuning PID controller.

    Args:
        kind: ``t1`` for type-1 sets, ``t2`` for interval type-2 sets.
        preset: ``paper`` follows the paper's text, mended where it diverges;
            ``published-code`` does what the author's code did: proportional control.
        dt: Sample time in s.

    Raises:
        InvalidInput: ``dt`` is not positive, or there is no such kind or preset.
    """
    if not (isfinite(dt) and dt > 0.0):
        raise InvalidInput(f"the sample time must be positive, got {dt:g} s")
    tune = fuzzy_tuner(kind, preset)
    if preset == "published-code":
        channel = MemorylessChannel(tune, MemorylessParameters())
        return FuzzyPidController(dt, channel, channel, wraps=False)
    return FuzzyPidController(
        dt,
        SelfTuningChannel(tune, dt, SelfTuningParameters()),
        SelfTuningChannel(tune, dt, SelfTuningParameters(limit=MAX_YAW_RATE)),
        wraps=True,
    )
