"""PID presets: the paper's text, its published code, and the recommended controller."""

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
from omnidrive.parameter import check_choice, check_sample_time

PidPreset = Literal["paper", "published-code", "recommended"]

MAX_YAW_RATE = 3.14
"""Yaw-rate limit of the paper's predictive controller, in rad/s."""

PidController = FuzzyPidController | TrackingPidController


def fuzzy_pid(kind: Kind, preset: PidPreset, dt: float) -> PidController:
    """Return a self-tuning PID controller.

    Args:
        kind: ``t1`` for type-1 sets, ``t2`` for interval type-2 sets, ``t3`` for interval type-3.
        preset: ``paper`` follows the paper's text, corrected where it diverges;
            ``published-code`` is the author's code: proportional control;
            ``recommended`` follows the reference's motion and corrects signed errors in B, with
            gains tuned by the paper's fuzzy system in the same way for both signs of an error.
        dt: Sample time in s.

    Raises:
        InvalidInput: ``dt`` is not positive, or the kind or preset is unknown.
    """
    check_choice("preset", preset, get_args(PidPreset))
    return _pid(fuzzy_tuner(kind, "paper" if preset == "recommended" else preset), preset, dt)


def classical_pid(preset: PidPreset, dt: float) -> PidController:
    """Return the same controller with constant gains, as a baseline for the fuzzy system.

    Args:
        preset: As for :func:`fuzzy_pid`; the gains are the initial values of the tuned ones.
        dt: Sample time in s.

    Raises:
        InvalidInput: ``dt`` is not positive, or the preset is unknown.
    """
    check_choice("preset", preset, get_args(PidPreset))
    return _pid(no_tuning, preset, dt)


def _pid(tune: Tuner, preset: PidPreset, dt: float) -> PidController:
    check_sample_time(dt)
    if preset == "published-code":
        channel = MemorylessChannel(tune, MemorylessParameters())
        return FuzzyPidController(dt, channel, channel, wraps_heading=False)
    if preset == "paper":
        return FuzzyPidController(
            dt,
            SelfTuningChannel(tune, dt, SelfTuningParameters()),
            SelfTuningChannel(tune, dt, SelfTuningParameters(limit=MAX_YAW_RATE)),
            wraps_heading=True,
        )
    x, y, heading = (TrackingChannel(tune, dt, TrackingParameters()) for _ in range(3))
    return TrackingPidController(dt, x, y, heading)
