"""The PID controllers for compiled loops: the laws that their steps call, in the same order."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, nan
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow
from omnidrive.control.pid.channel import (
    Channel,
    MemorylessChannel,
    SelfTuningChannel,
    TrackingChannel,
    Tuner,
    no_tuning,
)
from omnidrive.control.pid.laws import (
    Gains,
    SelfTuningParameters,
    SelfTuningState,
    TrackingParameters,
    TrackingState,
    fuzzy_inputs,
    low_pass,
    memoryless_law,
    mirror_to_negative,
    self_tuning_law,
    tracking_integral,
    tracking_law,
    tune_bounded_gains,
    tune_gains,
)
from omnidrive.control.pid.tracking import (
    lead,
    mean_velocity,
    missing_motion,
    pose_error,
    rate_of_error,
    saturated,
    time_between,
    twist_of,
    whole_samples,
)
from omnidrive.control.pid.tuners import FuzzyTuner
from omnidrive.fuzzy.kernels import infer_rows
from omnidrive.geometry import BodyTwist, Pose, WorldTwist
from omnidrive.geometry.kernels import to_body, wrap

_Row = Float[Array, " floats"]
_RECORD = 5  # fields of TuningRecord


class _PackedTuner(NamedTuple):
    """Arrays of a fuzzy system, as for ``infer_rows``; without slices there is no tuning."""

    floats: Float[Array, " floats"]
    integers: Int[Array, " integers"]
    slices: Int[Array, "slices 4"]


_NO_TUNING = _PackedTuner(np.empty(0), np.empty(0, np.int64), np.empty((0, 4), np.int64))


def _packed(tune: Tuner) -> _PackedTuner | None:
    """Return the arrays of a tuner; None: it is not one of this package."""
    if isinstance(tune, FuzzyTuner):
        return _PackedTuner(*tune.inference.arrays)
    return _NO_TUNING if tune is no_tuning else None


def _tuners(kind: Any, channels: Sequence[Any], dt: float) -> list[_PackedTuner] | None:
    """Return the tuners of channels of one kind; None: a channel or tuner is of another kind.

    Channels with memory must be distinct, and have the sample time of the controller.
    """
    tuners = [_packed(each.tune) for each in channels if type(each) is kind]
    found = [tuner for tuner in tuners if tuner is not None]
    if kind is not MemorylessChannel:
        shared = len({id(each) for each in channels}) < len(channels)
        if shared or any(getattr(each, "dt", None) != dt for each in channels):
            return None
    return found if len(found) == len(channels) else None


@compiled
def _tuned(tuner: _PackedTuner, error: float, change: float) -> tuple[float, float, float]:
    """Return what the :data:`Tuner` returns; nan where it raises an error."""
    if len(tuner.slices) == 0:
        return 0.0, 0.0, 0.0
    if not (np.isfinite(error) and np.isfinite(change)):
        return nan, nan, nan
    rows, results = np.empty((1, 2)), np.empty((1, 3, 3))
    rows[0, 0], rows[0, 1] = error, change
    status, _ = infer_rows(tuner.floats, tuner.integers, tuner.slices, rows, results)
    if status != 0:
        return nan, nan, nan
    return results[0, 0, 0], results[0, 0, 1], results[0, 0, 2]


@compiled
def _record(gains: Gains, inputs: tuple[float, float], details: _Row) -> None:
    """Fill in the fields of a ``TuningRecord``."""
    details[0], details[1], details[2] = gains.kp, gains.ki, gains.kd
    details[3], details[4] = inputs[0], inputs[1]


class _TrackingData(NamedTuple):
    dt: float
    x: TrackingParameters
    y: TrackingParameters
    heading: TrackingParameters
    tune_x: _PackedTuner
    tune_y: _PackedTuner
    tune_heading: _PackedTuner


# places in the memory
_STARTED, _TIME, _POSE, _MOTION, _COMMAND, _RESPONSE, _CHANNELS = 0, 1, 2, 5, 8, 11, 14
_STATE = len(TrackingState._fields)


def tracking_pid_law(dt: float, channels: tuple[TrackingChannel, ...]) -> CompiledLaw | None:
    """Return the law of a tracking PID controller; None: a channel or its tuner is not ours."""
    tuners = _tuners(TrackingChannel, channels, dt)
    if tuners is None:
        return None
    x, y, heading = (each.parameters for each in channels)
    data = _TrackingData(dt, x, y, heading, *tuners)
    window = SetpointWindow(0.0, 3, 0.5 * dt)
    return CompiledLaw(_tracking_step, data, np.zeros(_CHANNELS + _STATE * len(channels)), window)


@compiled
def _tracking_step(  # noqa: PLR0917
    data: _TrackingData,
    memory: _Row,
    now: SampleState,
    setpoints: Float[Array, "3 6"],
    command: _Row,
    details: _Row,
) -> int:
    s, m, dt, t = setpoints, memory, data.dt, now.t
    pose = Pose(now.pose[0], now.pose[1], now.pose[2])
    begin, end = (s[0, 3], s[0, 4], s[0, 5]), (s[2, 3], s[2, 4], s[2, 5])
    motion = mean_velocity(begin, (s[1, 3], s[1, 4], s[1, 5]), end)
    lags = (data.x.lag, data.heading.lag)
    most = (data.x.acceleration, data.heading.acceleration)
    rate, missing, response = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0)
    if m[_STARTED] > 0.0:
        previous = Pose(m[_POSE], m[_POSE + 1], m[_POSE + 2])
        last = WorldTwist(m[_MOTION], m[_MOTION + 1], m[_MOTION + 2])
        held = BodyTwist(m[_COMMAND], m[_COMMAND + 1], m[_COMMAND + 2])
        response = BodyTwist(m[_RESPONSE], m[_RESPONSE + 1], m[_RESPONSE + 2])
        elapsed = time_between(m[_TIME], t, dt)
        rate = rate_of_error(pose, previous, last, whole_samples(elapsed, dt))
        missing, response = missing_motion(pose, previous, held, response, lags, most, elapsed)
    error = pose_error(pose, Pose(s[0, 0], s[0, 1], s[0, 2]))

    states, n = m[_CHANNELS:], _STATE
    distance = hypot(error[0], error[1])
    errors = (error[0], rate[0], missing[0], distance)
    x = _tracking_channel(data.x, data.tune_x, states[:n], errors, dt, details)
    errors = (error[1], rate[1], missing[1], distance)
    y = _tracking_channel(data.y, data.tune_y, states[n:], errors, dt, details[_RECORD:])
    errors = (error[2], rate[2], missing[2], abs(error[2]))
    turn = _tracking_channel(
        data.heading, data.tune_heading, states[2 * n :], errors, dt, details[2 * _RECORD :]
    )
    correction = saturated(x, y, turn, (data.x.limit, data.heading.limit))
    twist = twist_of(pose, lead(motion, begin, end, lags, most, dt), correction, dt)
    m[_STARTED], m[_TIME] = 1.0, t
    m[_POSE], m[_POSE + 1], m[_POSE + 2] = pose.x, pose.y, pose.yaw
    m[_MOTION], m[_MOTION + 1], m[_MOTION + 2] = motion.vx, motion.vy, motion.yaw_rate
    m[_COMMAND], m[_COMMAND + 1], m[_COMMAND + 2] = twist.vx, twist.vy, twist.yaw_rate
    m[_RESPONSE], m[_RESPONSE + 1], m[_RESPONSE + 2] = response.vx, response.vy, response.yaw_rate
    command[0], command[1], command[2] = twist.vx, twist.vy, twist.yaw_rate
    return 0


@compiled
def _tracking_channel(  # noqa: PLR0917
    parameters: TrackingParameters,
    tuner: _PackedTuner,
    state: _Row,
    errors: tuple[float, float, float, float],
    dt: float,
    details: _Row,
) -> float:
    """As ``TrackingChannel.step``; ``state``: the fields of its state."""
    error, rate, missing, distance = errors
    rate = low_pass(parameters.filter_time, state[2], rate, dt)
    inputs = fuzzy_inputs(parameters, error, rate)
    mirrored = mirror_to_negative(inputs[0], inputs[1])
    gains = tune_bounded_gains(parameters, _tuned(tuner, mirrored[0], mirrored[1]))
    before = TrackingState(state[0], state[1], state[2], state[3])
    integral, filtered = tracking_integral(parameters, gains, before, distance, missing, dt)
    state[0], state[1], state[2], state[3] = integral, filtered, rate, distance
    _record(gains, inputs, details)
    return tracking_law(parameters, gains, integral, error, distance, rate, dt)


class _WaypointData(NamedTuple):
    dt: float
    wraps: bool
    position: Any  # MemorylessParameters or SelfTuningParameters
    heading: Any
    tune_position: _PackedTuner
    tune_heading: _PackedTuner


def waypoint_law(
    dt: float, channels: tuple[Channel, Channel], *, wraps: bool
) -> CompiledLaw | None:
    """Return the law of a PID controller to waypoints; None: a channel or its tuner is not ours.

    Args:
        dt: Sample time, s.
        channels: Those of position and heading.
        wraps: Whether the heading difference is wrapped.
    """
    for kind, step in (
        (MemorylessChannel, _memoryless_step),
        (SelfTuningChannel, _self_tuning_step),
    ):
        tuners = _tuners(kind, channels, dt)
        if tuners is not None:
            position, heading = (each.parameters for each in channels)
            data = _WaypointData(dt, wraps, position, heading, *tuners)
            return CompiledLaw(step, data, np.zeros(8), SetpointWindow(dt, 1, 0.0))
    return None


@compiled
def _errors(
    data: _WaypointData, pose: Pose, setpoints: Float[Array, "1 6"]
) -> tuple[complex, float]:
    """Return the vector to the goal in W, m, and the heading difference, rad."""
    turn = setpoints[0, 2] - pose.yaw
    if data.wraps:
        turn = wrap(turn)
    return complex(setpoints[0, 0] - pose.x, setpoints[0, 1] - pose.y), turn


@compiled
def _set_command(velocity: complex, yaw_rate: float, pose: Pose, command: _Row) -> None:
    twist = to_body(WorldTwist(velocity.real, velocity.imag, yaw_rate), pose.yaw)
    command[0], command[1], command[2] = twist.vx, twist.vy, twist.yaw_rate


@compiled
def _memoryless_step(  # noqa: PLR0917
    data: _WaypointData,
    memory: _Row,
    now: SampleState,
    setpoints: Float[Array, "1 6"],
    command: _Row,
    details: _Row,
) -> int:
    pose = Pose(now.pose[0], now.pose[1], now.pose[2])
    error, turn = _errors(data, pose, setpoints)
    p, size = data.position, abs(error)
    inputs = (p.error_gain * size, p.change_gain * size)
    gains = tune_gains(p, _tuned(data.tune_position, inputs[0], inputs[1]))
    velocity = memoryless_law(gains, error)
    _record(gains, inputs, details)
    p = data.heading
    inputs = (p.error_gain * turn, p.change_gain * turn)
    gains = tune_gains(p, _tuned(data.tune_heading, inputs[0], inputs[1]))
    _record(gains, inputs, details[_RECORD:])
    _set_command(velocity, memoryless_law(gains, turn).real, pose, command)
    return 0


@compiled
def _self_tuning_step(  # noqa: PLR0917
    data: _WaypointData,
    memory: _Row,
    now: SampleState,
    setpoints: Float[Array, "1 6"],
    command: _Row,
    details: _Row,
) -> int:
    pose = Pose(now.pose[0], now.pose[1], now.pose[2])
    error, turn = _errors(data, pose, setpoints)
    m, size = memory, abs(error)
    if m[0] == 0.0:  # the first sample
        m[0], m[3], m[4], m[5], m[7] = 1.0, error.real, error.imag, size, turn
    state = SelfTuningState(complex(m[1], m[2]), complex(m[3], m[4]), m[5])
    gains = _self_tuned(data.position, data.tune_position, m[5], size, data.dt, details)
    velocity, integral = self_tuning_law(data.position, gains, state, error, data.dt)
    m[1], m[2], m[3], m[4], m[5] = integral.real, integral.imag, error.real, error.imag, size

    before = SelfTuningState(m[6], m[7], m[7])
    gains = _self_tuned(data.heading, data.tune_heading, m[7], turn, data.dt, details[_RECORD:])
    yaw_rate, m[6] = self_tuning_law(data.heading, gains, before, turn, data.dt)
    m[7] = turn
    _set_command(velocity, yaw_rate.real, pose, command)
    return 0


@compiled
def _self_tuned(  # noqa: PLR0917
    parameters: SelfTuningParameters,
    tuner: _PackedTuner,
    before: float,
    magnitude: float,
    dt: float,
    details: _Row,
) -> Gains:
    """Return the gains as ``SelfTuningChannel``; ``before``: magnitude at the sample before."""
    rate = (magnitude - before) / dt
    inputs = (parameters.error_gain * magnitude, parameters.change_gain * rate)
    gains = tune_gains(parameters, _tuned(tuner, inputs[0], inputs[1]))
    _record(gains, inputs, details)
    return gains
