"""Parameters of the drive: what is known, what is identified, and the bounds of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import hypot
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.parameter import Bounds, check_bounds
from omnidrive.robot import Robot
from omnidrive.robot.slip import Vector

DELAYS = 5
"""Number of delays that are compared: 0 to 4 sample times in addition to the known delay."""
GAIN_ERROR, LAG_ERROR, YAW_LAG_ERROR = 0.07, 0.07, 0.015
"""Standard deviations of the parameters before the first sample; 1, s, s."""
_EXCITED = 0.5
"""Share of the initial standard error below which a parameter is excited."""


DRIVE_PARAMETERS = np.dtype(
    [("gains", "f8", 3), ("lag", "f8"), ("delay", "f8"), ("yaw_lag", "f8")], align=True
)
"""The first fields of :class:`DriveEstimate`: the response of a drive to commands."""


class DriveSettings(NamedTuple):
    """Bounds of the identified parameters, and forgetting."""

    min_gain: Annotated[float, Bounds(0.01, 1.0)] = 0.7
    """Least gain of an axis."""
    max_gain: Annotated[float, Bounds(1.0, 100.0)] = 1.3
    """Largest gain of an axis."""
    max_lag: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.3
    """Largest lag in addition to that of the model."""
    max_delay: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.2
    """Largest delay of the commands, that of the model included."""
    memory: Annotated[float, Bounds(1.0, 1e6, "s")] = 30.0
    """Time constant with which old information is forgotten."""


class DriveEstimate(NamedTuple):
    """Identified parameters of the drive, with their standard errors."""

    gains: Vector = (1.0, 1.0, 1.0)
    """Ratio of the steady twist to the commanded one along x, y and yaw."""
    lag: float = 0.0
    """Lag of the motors in addition to that of the model, s."""
    delay: float = 0.0
    """Delay of the commands, that of the model included, s."""
    yaw_lag: float = 0.0
    """As ``lag``, in yaw; ``lag`` is that in x and y."""
    gain_errors: Vector = (GAIN_ERROR, GAIN_ERROR, GAIN_ERROR)
    lag_error: float = LAG_ERROR
    delay_error: float = 0.0
    """From the probabilities of the compared delays and the distance between them."""
    yaw_lag_error: float = hypot(LAG_ERROR, YAW_LAG_ERROR)
    sum_error: float = LAG_ERROR
    """Of the sum of lag and delay: smooth motions do not distinguish the two."""

    @property
    def parameters(self) -> Array:
        """The parameters without their standard errors: a record of :data:`DRIVE_PARAMETERS`."""
        return np.array([(self.gains, self.lag, self.delay, self.yaw_lag)], DRIVE_PARAMETERS)

    @property
    def excited(self) -> tuple[bool, bool, bool, bool]:
        """Whether the motion sufficed to estimate the gains, and the sum of lag and delay."""
        x, y, yaw = (error < _EXCITED * GAIN_ERROR for error in self.gain_errors)
        return x, y, yaw, self.sum_error < _EXCITED * LAG_ERROR


def settings_around(known: DriveEstimate, period: float) -> DriveSettings:
    """Return the default settings, with wider bounds where the known drive is beyond or near them.

    Args:
        known: The drive before the first sample.
        period: Sample time, s.
    """
    usual = DriveSettings()
    return usual._replace(
        min_gain=min(usual.min_gain, usual.min_gain * min(known.gains)),
        max_gain=max(usual.max_gain, usual.max_gain * max(known.gains)),
        max_lag=max(usual.max_lag, 2.0 * known.lag),
        max_delay=max(usual.max_delay, known.delay + (DELAYS - 1) * period),
    )


def check_start(settings: DriveSettings, initial: DriveEstimate) -> None:
    """Check settings, and that they allow the initial parameters.

    Raises:
        InvalidInput: A setting is outside its domain, or an initial value outside the bounds.
    """
    check_bounds(settings)
    for name, value, low, high in (
        *(("gain", gain, settings.min_gain, settings.max_gain) for gain in initial.gains),
        ("lag", initial.lag, 0.0, settings.max_lag),
        ("delay", initial.delay, 0.0, settings.max_delay),
    ):
        if not low <= value <= high:
            raise InvalidInput(
                f"the {name} before adaptation is {value:g}, outside its bounds {low:g} to {high:g}"
            )


DRIVE_ESTIMATE = np.dtype([
    ("gains", "f8", 3),
    ("lag", "f8"),
    ("delay", "f8"),
    ("yaw_lag", "f8"),
    ("gain_errors", "f8", 3),
    ("lag_error", "f8"),
    ("delay_error", "f8"),
    ("yaw_lag_error", "f8"),
    ("sum_error", "f8"),
], align=True)  # fmt: skip
"""The fields of :class:`DriveEstimate`."""


def drive_estimate(record: np.void) -> DriveEstimate:
    """Return the estimate in a record of :data:`DRIVE_ESTIMATE`."""
    gains, lag, delay, yaw_lag, gain_errors, *errors = (
        record[name].tolist() for name in DriveEstimate._fields
    )
    return DriveEstimate(tuple(gains), lag, delay, yaw_lag, tuple(gain_errors), *errors)


@compiled
def write_estimate(record: Any, values: Float[Array, " values"]) -> None:
    """Write a record of :data:`DRIVE_ESTIMATE` into a row with the columns of the log of a run.

    The columns are those of :data:`DRIVE_UNITS`: the values of the record in their order.
    """
    values.view(DRIVE_ESTIMATE)[0] = record


def logged_drive(details: Mapping[str, Float[Array, " rows"]]) -> DriveEstimate | None:
    """Return the last estimates in the details of a run; None: it has none.

    The columns are those of :data:`DRIVE_UNITS`.
    """
    if not details.keys() >= DRIVE_UNITS.keys():
        return None
    table = np.column_stack([details[name] for name in DRIVE_UNITS])
    finite = np.flatnonzero(np.isfinite(table).all(axis=1))
    return drive_estimate(table[finite[-1]].view(DRIVE_ESTIMATE)[0]) if len(finite) else None


def identified_robot(robot: Robot, estimate: DriveEstimate) -> Robot:
    """Return a robot with the identified gains and motor lag, for its file.

    What the motion did not determine (:attr:`DriveEstimate.excited`) is unchanged. The delay is no
    parameter of a robot.
    """
    *moving, answering = estimate.excited
    pairs = zip(moving, estimate.gains, robot.drive_gain, strict=True)
    x, y, yaw = (found if excited else known for excited, found, known in pairs)
    lag = estimate.lag if answering else robot.motor_lag
    return replace(robot, drive_gain=(x, y, yaw), motor_lag=lag)


DRIVE_UNITS: Mapping[str, str] = MappingProxyType(
    {
        "drive_gain_x": "1",
        "drive_gain_y": "1",
        "drive_gain_yaw": "1",
        "drive_lag": "s",
        "drive_delay": "s",
        "drive_yaw_lag": "s",
        "drive_gain_x_error": "1",
        "drive_gain_y_error": "1",
        "drive_gain_yaw_error": "1",
        "drive_lag_error": "s",
        "drive_delay_error": "s",
        "drive_yaw_lag_error": "s",
        "drive_lag_and_delay_error": "s",
    }
)
"""Columns of the log of a run and their units: the values of a :data:`DRIVE_ESTIMATE`.
``..._error`` are standard errors; the last one is that of the sum of lag and delay."""
