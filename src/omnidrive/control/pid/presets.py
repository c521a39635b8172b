"""Named PID controllers: the paper's text, what its published code did, and this project's own."""

from __future__ import annotations

from typing import Literal, get_args

from omnidrive.control.pid.channel import (
    MemorylessChannel,
    SelfTuningChannel,
    TrackingChannel,
    Tuner,
    no_tuning,
)
from omnidrive.control.pid.controller import FuzzyPidController, TrackingPidController
from omnidrive.control.pid.laws import (
    MemorylessParameters,
    SelfTuningParameters,
    TrackingParameters,
)
from omnidrive.control.pid.tuners import Kind, fuzzy_tuner
from omnidrive.errors import InvalidInput
from omnidrive.parameter import check_sample_time

PidPreset = Literal["paper", "published-code", "recommended"]

MAX_YAW_RATE = 3.14
"""Limit of the paper's predictive controller, in rad/s."""

PidController = FuzzyPidController | TrackingPidController


def fuzzy_pid(kind: Kind, preset: PidPreset, dt: float) -> PidController:
    """Self-tuning PID controller.

    Args:
        kind: ``t1`` for type-1 sets, ``t2`` for interval type-2 sets, ``t3`` for interval type-3.
        preset: ``paper`` follows the paper's text, mended where it diverges;
            ``published-code`` does what the author's code did: proportional control;
            ``recommended`` follows the reference's motion and corrects signed errors in B, tuned by
            the paper's fuzzy system, which sees both signs of an error alike.
        dt: Sample time in s.

    Raises:
        InvalidInput: ``dt`` is not positive, or there is no such kind or preset.
    """
    return _pid(fuzzy_tuner(kind, "paper" if preset == "recommended" else preset), preset, dt)


def classical_pid(preset: PidPreset, dt: float) -> PidController:
    """The same controllers with constant gains: what the fuzzy system has to be better than.

    Args:
        preset: As for :func:`fuzzy_pid`; its gains are the middle of the tuned ones.
        dt: Sample time in s.

    Raises:
        InvalidInput: ``dt`` is not positive, or there is no such preset.
    """
    return _pid(no_tuning, preset, dt)


def _pid(tune: Tuner, preset: PidPreset, dt: float) -> PidController:
    check_sample_time(dt)
    if preset == "published-code":
        channel = MemorylessChannel(tune, MemorylessParameters())
        return FuzzyPidController(dt, channel, channel, wraps=False)
    if preset == "paper":
        return FuzzyPidController(
            dt,
            SelfTuningChannel(tune, dt, SelfTuningParameters()),
            SelfTuningChannel(tune, dt, SelfTuningParameters(limit=MAX_YAW_RATE)),
            wraps=True,
        )
    if preset == "recommended":
        x, y, heading = (TrackingChannel(tune, dt, TrackingParameters()) for _ in range(3))
        return TrackingPidController(dt, x, y, heading)
    raise InvalidInput(f"there is no preset '{preset}'; there are {', '.join(get_args(PidPreset))}")
