"""Signs of an unstable loop: commands that move back and forth, and estimates at a bound."""

from __future__ import annotations

import numpy as np

from omnidrive.estimation.drive_estimate import (
    DELAYS,
    DriveEstimate,
    logged_drive,
    settings_around,
)
from omnidrive.reference import Reference
from omnidrive.simulation import Run

REVERSAL = (0.01, 0.01, 0.04)
"""Least change of the command between two samples that counts; m/s, m/s, rad/s."""
STRAIGHT = 0.02  # rad/s, of the direction of travel
AT_REST = 1e-3  # m/s
MIN_SAMPLES = 10
CLOSE = 1e-3  # to a bound, of its size


def straight(reference: Reference, t: np.ndarray) -> np.ndarray:
    """Return at which samples the reference moves straight ahead or rests."""
    dt = float(t[1] - t[0])
    velocity = reference.window(0.0, len(t), dt)[:, 3:5] @ np.array([1.0, 1.0j])
    turning = np.abs(np.angle(velocity[1:] * velocity[:-1].conj())) / dt
    turning = np.append(turning, turning[-1])
    return (turning < STRAIGHT) | (np.abs(velocity) < AT_REST)


def reversals(run: Run, which: np.ndarray) -> float:
    """Return the share of samples in which the command turns back: of the axis with the most.

    0 where there are less than :data:`MIN_SAMPLES` of these samples.
    """
    changes = np.diff(run.command, axis=0)
    large = np.abs(changes) > REVERSAL
    back = large[1:] & large[:-1] & (changes[1:] * changes[:-1] < 0.0)
    counted = which[:-2] & which[1:-1] & which[2:]
    return float(back[counted].mean(axis=0).max()) if counted.sum() >= MIN_SAMPLES else 0.0


def at_bounds(run: Run) -> int:
    """Return how many identified parameters of the drive are at a bound in the end.

    A lag or a delay of 0 counts as none: most plants have no more than the model.
    """
    found = logged_drive(run.details)
    if found is None:
        return 0
    dt = float(run.t[1] - run.t[0])
    bounds = settings_around(DriveEstimate(), dt)
    low, high = (1.0 + CLOSE) * bounds.min_gain, (1.0 - CLOSE) * bounds.max_gain
    delay = min(bounds.max_delay, (DELAYS - 1) * dt)
    return (
        sum(not low < gain < high for gain in found.gains)
        + (found.lag >= (1.0 - CLOSE) * bounds.max_lag)
        + (found.delay >= (1.0 - CLOSE) * delay)
    )
