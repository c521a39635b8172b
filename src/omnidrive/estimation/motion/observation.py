"""Update of the motion observer by one measurement."""

from __future__ import annotations

from math import cos, isfinite, sin
from typing import Any, NamedTuple

from omnidrive.compiled import compiled
from omnidrive.estimation.drive.drive_identification import (
    APPROACH,
    CONTINUE,
    RESTART,
    START,
    DriveSample,
)
from omnidrive.estimation.motion.acceleration_ratio import forget_response, update_reached
from omnidrive.estimation.motion.caution import unknown_delay, update_caution
from omnidrive.estimation.motion.motion_memory import MotionMemory, restart
from omnidrive.estimation.motion.motion_observer import (
    STEADY_SATURATION,
    correct,
    correct_twist,
    inflate_twist_variance,
    predict,
)
from omnidrive.estimation.motion.pose_noise import NOISY, axis_variance
from omnidrive.estimation.motion.robot_model import RobotModel, fastest_wheel, is_plausible
from omnidrive.geometry.kernels import wrap_angle
from omnidrive.robot.slip import Vector

_MIN_GAP, _MAX_GAP = 0.5, 5.0
"""Sample times since the last step: up to the first the clock is wrong, and one sample time has
passed; after the second the motion observer starts again."""
_JUMP = 2.0
"""Wheel speed of the displacement between two samples, as a multiple of the maximum, above which
the poses are wrong."""
_EXPLAINED = 2.0
"""Mean square of the innovations of a hypothesis over their variance, up to which it explains the
motion."""


class Measurement(NamedTuple):
    """What is measured in a step; the scalars are in an array, which is filled in place."""

    elapsed: float
    """Time since the last step, s; NaN in the first step of a run."""
    pose: Vector
    """Measured pose in W; m, m, rad."""
    twist: Vector
    """Estimated body twist, m/s, m/s, rad/s; NaN if it is unknown."""
    variances: Vector
    """Variances of the measured pose along the axes of B, m^2, m^2, rad^2; negative: unknown."""
    fresh: bool
    """Whether the pose is a new measurement."""


@compiled
def observe(
    robot: RobotModel, memory: MotionMemory, now: Measurement, dt: float, steady: bool
) -> None:
    """Update the motion observer; ``dt`` is the sample time in s."""
    known, state = is_plausible(robot, now.twist), memory.state[0]
    elapsed = dt if now.elapsed <= _MIN_GAP * dt else now.elapsed  # a wrong clock
    if not elapsed <= _MAX_GAP * dt:
        first = not isfinite(elapsed)  # before the first step, the robot is at rest
        restart(memory, now.pose, now.twist if known and first else (0.0, 0.0, 0.0))
        for a in range(0 if first else 3):
            inflate_twist_variance(robot.model, state, a, dt)
        if first:
            state.drive = robot.drive[0]
        _identify(robot.identify, START if first else RESTART, robot, memory, now, dt, dt)
        return
    pose = (state.pose[0], state.pose[1], state.pose[2])
    twist = (state.twist[0], state.twist[1], state.twist[2])
    shares = predict(robot.model, memory, elapsed, dt)
    if now.fresh:
        update_reached(robot.model, robot.faces, state, pose, twist, now.pose, elapsed, steady)
        correct(robot.model, state, now.pose, now.variances, dt, shares, steady)
    if known:
        correct_twist(robot.model, state, now.twist, dt)
    event = CONTINUE if steady else APPROACH
    if now.fresh and _jumps(robot, pose, now.pose, elapsed):
        forget_response(state)
        event, elapsed = START, dt
    _identify(robot.identify, event, robot, memory, now, elapsed, dt)
    steady = steady and shares.disturbed <= STEADY_SATURATION
    state.lead = state.drive.lag if steady else 0.0
    state.yaw_lead = state.drive.yaw_lag if steady else 0.0


@compiled
def _jumps(robot: RobotModel, before: Vector, measured: Vector, elapsed: float) -> bool:
    """Return whether a robot cannot have moved from an estimated pose to a measured one.

    The poses before or those from now on are wrong, so that what they have shown of the drive may
    be wrong, too.
    """
    c, s = cos(before[2]), sin(before[2])
    x, y = measured[0] - before[0], measured[1] - before[1]
    twist = (c * x + s * y, c * y - s * x, wrap_angle(measured[2] - before[2]))
    return fastest_wheel(robot, twist) > _JUMP * robot.max_wheel_speed * elapsed


@compiled
def _identify(  # noqa: PLR0917
    identify: Any,
    event: int,
    robot: RobotModel,
    memory: MotionMemory,
    now: Measurement,
    elapsed: float,
    period: float,
) -> None:
    """Update the identified parameters of the drive after a sample, unless poses are noisy."""
    if identify is None:
        update_caution(memory.state[0], 1.0, elapsed)
        return
    state, sent, variances = memory.state[0], memory.commands[0], now.variances
    twist = state.twist
    if variances[0] < 0.0:
        variances = (axis_variance(state, 0), axis_variance(state, 1), axis_variance(state, 2))
    goes_on = event in (CONTINUE, APPROACH)
    if goes_on and max(variances[0], variances[1]) > NOISY * NOISY:
        event, elapsed = START, period
    pose = now.pose
    if not now.fresh:  # lost, or the last one again
        pose = (state.pose[0], state.pose[1], state.pose[2])
    sample = DriveSample(
        (sent[0], sent[1], sent[2]),
        elapsed,
        pose,
        (twist[0], twist[1], twist[2]),
        variances,
        now.fresh,
    )
    identify(event, robot.model, robot.bounds, robot.drive, memory.identified, sample)
    found = memory.identified.state[0]
    if found.applied.delay != state.drive.delay:  # the motion was estimated for another delay
        chosen, response = found.hypotheses[found.chosen], state.response
        response.delayed = response.absent = response.late = response.prompt = 0.0
        for a in range(3 if chosen.mean_square < _EXPLAINED else 0):
            state.twist[a], state.disturbance[a] = chosen.twist[a], chosen.disturbance[a]
    state.drive = found.applied
    unknown = unknown_delay(found.estimate.sum_error, found.estimate.delay_error, period)
    update_caution(state, unknown, elapsed)
