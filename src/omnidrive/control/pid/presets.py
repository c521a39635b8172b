"""Named fuzzy PID controllers: the paper's text, and what its published code did."""

from __future__ import annotations

from math import isfinite

from omnidrive.control.pid.channel import MemorylessChannel, SelfTuningChannel
from omnidrive.control.pid.controller import FuzzyPidController
from omnidrive.control.pid.laws import MemorylessParameters, SelfTuningParameters
from omnidrive.control.pid.tuners import Kind, Preset, fuzzy_tuner
from omnidrive.errors import InvalidInput

MAX_YAW_RATE = 3.14
"""Limit of the paper's predictive controller, in rad/s."""


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
