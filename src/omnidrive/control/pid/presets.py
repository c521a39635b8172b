"""PID presets: the paper's text, its published code, and the recommended controller."""

from __future__ import annotations

from typing import Literal, get_args

from omnidrive.control.pid.channel import PidChannel
from omnidrive.control.pid.laws import (
    MemorylessParameters,
    SelfTuningParameters,
    TrackingParameters,
)
from omnidrive.control.pid.options import (
    HEADING_BRAKING_SHARE,
    Channels,
    FuzzyPidOptions,
    Law,
    PidOptions,
    system_preset,
)
from omnidrive.control.pid.tracking_controller import TrackingPidController
from omnidrive.control.pid.tuners import Kind, Tuner, fuzzy_tuner, no_tuning
from omnidrive.control.pid.waypoint_controller import FuzzyPidController
from omnidrive.parameter import check_choice, check_sample_time
from omnidrive.robot import Robot

PidPreset = Literal["paper", "published-code", "recommended"]

MAX_YAW_RATE = 3.14
"""Yaw-rate limit of the paper's predictive controller, in rad/s."""

_MIN = 1e-6  # m/s or rad/s, m/s^2 or rad/s^2: for a robot without grip

_FUZZY, _CONSTANT = FuzzyPidOptions(), PidOptions()

PidController = FuzzyPidController | TrackingPidController


def fuzzy_pid(
    kind: Kind,
    preset: PidPreset,
    dt: float,
    robot: Robot | None = None,
    *,
    forces: bool = True,
    options: FuzzyPidOptions | None = None,
) -> PidController:
    """Return a self-tuning PID controller.

    Args:
        kind: ``t1`` for type-1 sets, ``t2`` for interval type-2 sets, ``t3`` for interval type-3.
        preset: ``paper`` follows the paper's text, corrected where it diverges;
            ``published-code`` is the author's code: proportional control;
            ``recommended`` follows the reference's motion and corrects signed errors in B, with
            gains tuned by the paper's fuzzy system in the same way for both signs of an error.
        dt: Sample time in s.
        robot: Robot whose speeds, accelerations and lag ``recommended`` is made for, see
            :func:`robot_parameters`. None: one that executes every command.
        forces: Whether motors, masses and friction act; otherwise only the speeds apply.
        options: Gains, membership functions and rules that differ from those of the preset.

    Raises:
        InvalidInput: ``dt`` is not positive, the kind or preset is unknown, or a parameter does not
            belong to the preset.
    """
    check_choice("preset", preset, get_args(PidPreset))
    given = options or _FUZZY
    tuner = fuzzy_tuner(kind, system_preset(preset), given.fuzzy)
    return _pid(tuner, preset, dt, robot, given.channels, forces=forces)


def classical_pid(
    preset: PidPreset,
    dt: float,
    robot: Robot | None = None,
    *,
    forces: bool = True,
    options: PidOptions | None = None,
) -> PidController:
    """Return the same controller with constant gains, as a baseline for the fuzzy system.

    Args:
        preset: As for :func:`fuzzy_pid`; the gains are the initial values of the tuned ones.
        dt: Sample time in s.
        robot: As for :func:`fuzzy_pid`.
        forces: Likewise.
        options: Gains that differ from those of the preset.

    Raises:
        InvalidInput: ``dt`` is not positive, the preset is unknown, or a parameter does not belong
            to it.
    """
    check_choice("preset", preset, get_args(PidPreset))
    return _pid(no_tuning, preset, dt, robot, (options or _CONSTANT).channels, forces=forces)


def robot_parameters(
    robot: Robot, *, forces: bool = True
) -> tuple[TrackingParameters, TrackingParameters]:
    """Return the parameters of ``recommended`` for position and heading of a robot.

    Limits and accelerations are those that its wheels reach in every direction
    (:attr:`~omnidrive.robot.Robot.top_speeds`, :attr:`~omnidrive.robot.Robot.top_accelerations`).

    Args:
        robot: The robot.
        forces: Whether motors, masses and friction act: otherwise there is neither a lag nor a
            limit of the acceleration.
    """
    position, heading = (TrackingParameters(limit=max(top, _MIN)) for top in robot.top_speeds)
    heading = heading._replace(braking_share=HEADING_BRAKING_SHARE)
    if not forces:
        return position, heading
    both = zip((position, heading), robot.top_accelerations, robot.lag, strict=True)
    position, heading = (
        parameters._replace(acceleration=max(top, _MIN), lag=lag + robot.motor_lag)
        for parameters, top, lag in both
    )
    return position, heading


def _pid(
    tune: Tuner,
    preset: PidPreset,
    dt: float,
    robot: Robot | None,
    channels: Channels,
    *,
    forces: bool,
) -> PidController:
    check_sample_time(dt)

    def given(position: Law, heading: Law) -> tuple[Law, Law]:
        """Return the parameters of both channels with the given options."""
        return (
            channels[0].applied(position, "position", preset),
            channels[1].applied(heading, "heading", preset),
        )

    if preset == "published-code":
        both = given(MemorylessParameters(), MemorylessParameters())
        first, second = (PidChannel(tune, dt, each) for each in both)
        return FuzzyPidController(dt, first, second, wraps_heading=False)
    if preset == "paper":
        waypoint = given(SelfTuningParameters(), SelfTuningParameters(limit=MAX_YAW_RATE))
        distance, turn = (PidChannel(tune, dt, each) for each in waypoint)
        return FuzzyPidController(dt, distance, turn, wraps_heading=True)
    position = heading = TrackingParameters()
    if robot is not None:
        position, heading = robot_parameters(robot, forces=forces)
    position, heading = given(position, heading)
    tracking = (PidChannel(tune, dt, each) for each in (position, position, heading))
    return TrackingPidController(dt, *tracking)
