"""Identification of the lag of a plant from its response."""

from __future__ import annotations

import numpy as np

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, twist_between
from omnidrive.simulation.plant import Plant


def identify_lag(
    plant: Plant, rng: np.random.Generator, dt: float = 0.02, steps: int = 400
) -> tuple[float, float]:
    """Return the time constants with which translation and rotation follow the commands, s.

    The commands are a random walk of twists with steps of 1 cm/s and 0.02 rad/s, too small for
    wheel slip. Least squares fit ``b_k = b_{k-1} + g (c_k - b_{k-1})`` to the twists b_k between
    consecutive poses and the commanded ones c_k; with ``g = dt / (lag + dt)`` this is backward
    Euler of ``lag db/dt = c - b`` (Ljung, "System Identification", 2nd ed. 1999, 4.2).

    Args:
        plant: The plant; it moves by some decimetres.
        rng: Generator of the random walk.
        dt: Sample time, s; preferably a few time constants.
        steps: Number of samples.

    Raises:
        InvalidInput: The motion of the plant does not follow the commands.
    """
    pose = plant.reset(Pose(0.0, 0.0, 0.0)).pose
    commanded, realised = np.zeros((steps, 3)), np.zeros((steps, 3))
    command = np.zeros(3)
    for k in range(steps):
        command = 0.98 * command + rng.normal(size=3) * [0.01, 0.01, 0.02]
        after = plant.step(BodyTwist(*command.tolist()), dt).pose
        commanded[k], realised[k] = command, twist_between(pose, after, dt)
        pose = after
    changes, errors = np.diff(realised, axis=0), commanded[1:] - realised[:-1]
    lags = []
    for axes in (slice(0, 2), slice(2, 3)):
        change, error = changes[:, axes], errors[:, axes]
        gain = float((change * error).sum() / (error**2).sum())
        if not gain > 0.0:
            raise InvalidInput(
                "the motion of the plant does not follow the commands: it has no lag to identify"
            )
        lags.append(max(dt / gain - dt, 0.0))
    return lags[0], lags[1]
