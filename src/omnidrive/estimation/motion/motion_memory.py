"""State of the motion observer: its estimates, parameters of the drive, and sent commands."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.drive.identification_state import (
    IdentificationMemory,
    identification_memory,
)
from omnidrive.estimation.drive_estimate import DRIVE_PARAMETERS
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot.slip import Vector

NOISE = np.dtype([
    ("position_variance", "f8"),
    ("yaw_variance", "f8"),
    ("difference", "f8", 3),
    ("residual", "f8", 3),
    ("measurements", "i8"),
], align=True)  # fmt: skip
"""Estimated variance of measured positions (m^2) and yaws (rad^2); of every axis the last
difference of a measured displacement from the predicted one, and the last residual; and the number
of measurements. See :func:`~.pose_noise.estimate_noise` and :func:`~.motion_observer.correct`."""

RESPONSE = np.dtype([
    ("excess_ratio", "f8"),
    ("delayed", "f8"),
    ("absent", "f8"),
    ("late", "f8"),
    ("prompt", "f8"),
    ("load", "f8"),
    ("velocity", "f8", 3),
    ("change", "f8", 3),
], align=True)  # fmt: skip
"""Share of the planned acceleration that the robot reaches, minus the assumed one; how much its
response is delayed, absent in the first sample, and has lately been late, 0 to 1; how clearly hard
accelerations were followed at once, 0 to 1; and of the last sample the predicted acceleration over
its limits, the mean velocity in W, and the part of the predicted change of velocity that will act
in the next sample only, m/s, m/s, rad/s. See :func:`~.acceleration_ratio.reached_share`,
:func:`~.acceleration_ratio.response_ratio`, :func:`~.acceleration_ratio.is_late` and
:func:`~.acceleration_ratio.shows_no_delay`."""

MOTION = np.dtype([
    ("pose", "f8", 3),
    ("twist", "f8", 3),
    ("disturbance", "f8", 3),
    ("covariance", "f8", (3, 3, 3)),
    ("motors", "f8", 3),
    ("drive", DRIVE_PARAMETERS),
    ("lead", "f8"),
    ("yaw_lead", "f8"),
    ("noise", NOISE),
    ("response", RESPONSE),
    ("jump", "f8", 3),
    ("slip_time", "f8"),
    ("caution", "f8"),
], align=True)  # fmt: skip
"""Estimates of the observer. The axes are x, y and yaw of B. The state of an axis is (displacement,
twist, disturbance).

- ``pose``: in W; m, m, rad.
- ``twist``: body twist; m/s, m/s, rad/s.
- ``disturbance``: m/s, m/s, rad/s; where poses are noisy, of a command at the usual speed. See
  :func:`~.disturbance.disturbance_at`.
- ``covariance``: of every axis, in m^2 and so on, of the yaw axis in rad^2 and so on; the coupling
  between axes is neglected.
- ``motors``: twist that the motors follow: the commanded one with gains, delay and lag.
- ``drive``: known or identified parameters of the drive.
- ``lead``, ``yaw_lead``: parts of the lags that commands compensate, s.
- ``jump``: last displacement along the axes of a robot that was moved, otherwise 0; m, m, rad.
- ``slip_time``: for how long wheels have slipped up to now, s.
- ``caution``: 1 where the delay of the response is unknown, 0 where it is identified; see
  :mod:`~.caution`.
"""


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
    """State of the observer, with the earlier commands; all arrays are changed in place."""

    state: Any
    """The estimates, one record of :data:`MOTION`."""
    commands: Float[Array, "commands 3"]
    """Commanded twists, the latest one first: one more than take effect later."""
    identified: IdentificationMemory
    """State of the identification of the drive; empty without identification."""


def observed_motion(memory: MotionMemory) -> ObservedMotion:
    """Return the estimates at the last step."""
    state = memory.state[0]
    return ObservedMotion(
        Pose(*state["pose"].tolist()),
        BodyTwist(*state["twist"].tolist()),
        BodyTwist(*state["disturbance"].tolist()),
    )


def motion_memory(commands: int, identified: IdentificationMemory | None = None) -> MotionMemory:
    """Return the memory for a number of commands, with that of the identification."""
    return MotionMemory(
        np.zeros(1, MOTION), np.zeros((commands, 3)), identified or identification_memory(0)
    )


@compiled
def restart(memory: MotionMemory, pose: Vector, twist: Vector) -> None:
    """Start at a known pose with a known twist, without disturbance."""
    state = memory.state[0]
    noise, response = state.noise, state.response
    for a in range(3):
        state.pose[a], state.twist[a], state.disturbance[a] = pose[a], twist[a], 0.0
        state.motors[a] = twist[a]
        noise.difference[a] = noise.residual[a] = state.jump[a] = 0.0
    state.covariance[:] = 0.0
    memory.commands[:] = 0.0
    noise.position_variance = noise.yaw_variance = state.slip_time = state.caution = 0.0
    noise.measurements = 0
    response.excess_ratio = response.delayed = response.absent = response.late = 0.0
    response.prompt = response.load = 0.0
    response.velocity[:] = 0.0
    response.change[:] = 0.0


@compiled
def remember(memory: MotionMemory, command: Vector) -> None:
    """Insert a command in front of the earlier ones."""
    for k in range(len(memory.commands) - 1, 0, -1):
        for a in range(3):
            memory.commands[k, a] = memory.commands[k - 1, a]
    for a in range(3):
        memory.commands[0, a] = command[a]
