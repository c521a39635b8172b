"""State of the motion observer: its estimates, parameters of the drive, and sent commands."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.identification_state import IdentificationMemory, identification_memory
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot.slip import Vector

LAG, DELAY, LEAD, YAW_LAG, YAW_LEAD = 3, 4, 5, 6, 7
"""Indices of :attr:`MotionMemory.drive`; before them are the gains of x, y and yaw."""


class ObservedMotion(NamedTuple):
    """Estimates of the motion observer."""

    pose: Pose
    """Pose of B in W; m, m, rad."""
    twist: BodyTwist
    """Body twist; m/s, m/s, rad/s."""
    disturbance: BodyTwist
    """Twist that has to be added to the commands for the model to move as the robot does. Where the
    measured poses are noisy it is in proportion to the command; this is then the one of a command
    of 0.5 m/s, in yaw of 0.5 m/s over the radius of gyration."""


class MotionMemory(NamedTuple):
    """State of the observer; all arrays are changed in place.

    The axes are x, y and yaw of B. The state of an axis is (displacement, twist, disturbance); its
    covariance neglects the coupling between axes.
    """

    pose: Float[Array, " 3"]
    """Estimated pose in W; m, m, rad."""
    twist: Float[Array, " 3"]
    """Estimated body twist; m/s, m/s, rad/s."""
    disturbance: Float[Array, " 3"]
    """Disturbance, m/s, m/s, rad/s; where poses are noisy, of a command at the usual speed. See
    :func:`~.disturbance.disturbance_at`."""
    covariance: Float[Array, "axes 3 3"]
    """Covariance of every axis, in m^2 and so on; of the yaw axis in rad^2."""
    motors: Float[Array, " 3"]
    """Twist that the motors follow: the commanded one with gains, delay and lag."""
    drive: Float[Array, " 8"]
    """Gains along x, y and yaw, lag of the motors in x and y (s), delay of the commands (s), the
    part of the lag that commands compensate (s); and the latter and the lag in yaw."""
    identified: IdentificationMemory
    """State of the identification of these parameters; empty without identification."""
    commands: Float[Array, "commands 3"]
    """Commanded twists, the latest one first: one more than take effect later."""
    noise: Float[Array, " 13"]
    """Estimated variance of measured positions (m^2) and yaws (rad^2); of every axis the last
    difference of a measured displacement from the predicted one, and the last residual; the number
    of measurements; of every axis the last displacement of a robot that was moved, otherwise 0; and
    for how long wheels have slipped up to now, s.
    See :func:`~.pose_noise.estimate_noise` and :func:`~.motion_observer.correct`."""
    reached: Float[Array, " 3"]
    """Share of the planned acceleration that the robot reaches, minus the assumed one; how much its
    response is delayed, and has lately been late, 0 to 1; see
    :func:`~.acceleration_ratio.reached_share`, :func:`~.acceleration_ratio.response_ratio` and
    :func:`~.acceleration_ratio.is_late`."""


def observed_motion(memory: MotionMemory) -> ObservedMotion:
    """Return the estimates at the last step."""
    return ObservedMotion(
        Pose(*memory.pose.tolist()),
        BodyTwist(*memory.twist.tolist()),
        BodyTwist(*memory.disturbance.tolist()),
    )


def motion_memory(commands: int, identified: IdentificationMemory | None = None) -> MotionMemory:
    """Return the memory for a number of commands, with that of the identification."""
    return MotionMemory(
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros((3, 3, 3)),
        np.zeros(3),
        np.zeros(8),
        identified or identification_memory(0),
        np.zeros((commands, 3)),
        np.zeros(13),
        np.zeros(3),
    )


@compiled
def restart(memory: MotionMemory, pose: Vector, twist: Vector) -> None:
    """Start at a known pose with a known twist, without disturbance."""
    for a in range(3):
        memory.pose[a], memory.twist[a], memory.disturbance[a] = pose[a], twist[a], 0.0
        memory.motors[a] = twist[a]
    memory.covariance[:] = 0.0
    memory.commands[:] = 0.0
    memory.noise[:] = 0.0
    memory.reached[:] = 0.0


@compiled
def use_drive(memory: MotionMemory, drive: Any) -> None:
    """Predict with parameters of the drive, which have the fields of ``DriveParameters``."""
    for a in range(3):
        memory.drive[a] = drive.gains[a]
    memory.drive[LAG], memory.drive[DELAY] = drive.lag, drive.delay
    memory.drive[YAW_LAG] = drive.yaw_lag


@compiled
def remember(memory: MotionMemory, command: Vector) -> None:
    """Insert a command in front of the earlier ones."""
    for k in range(len(memory.commands) - 1, 0, -1):
        for a in range(3):
            memory.commands[k, a] = memory.commands[k - 1, a]
    for a in range(3):
        memory.commands[0, a] = command[a]
