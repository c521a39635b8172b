"""Identification of a model of the robot from how it answers."""

from __future__ import annotations

import numpy as np

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, twist_between
from omnidrive.simulation.plant import Plant


def identify_lag(
    plant: Plant, rng: np.random.Generator, dt: float = 0.02, steps: int = 400
) -> tuple[float, float]:
    """Time constants with which translation and rotation follow what is asked for, in s.

    The robot is asked for a random walk of twists so gentle, 1 cm/s and 0.02 rad/s from step to
    step, that no wheel spins. Least squares fit ``b_k = b_{k-1} + g (c_k - b_{k-1})`` to the
    twists b_k from pose to pose and those asked for, c_k; with ``g = dt / (lag + dt)`` that is
    backward Euler of ``lag db/dt = c - b`` (Ljung, "System Identification", 2nd ed. 1999, 4.2).

    Args:
        plant: The robot; it moves by some decimetres.
        rng: What the walk is drawn from.
        dt: Sample time in s; best a few time constants.
        steps: Samples.

    Raises:
        InvalidInput: The robot does not follow at all.
    """
    pose = plant.reset(Pose(0.0, 0.0, 0.0)).pose
    asked, done = np.zeros((steps, 3)), np.zeros((steps, 3))
    command = np.zeros(3)
    for k in range(steps):
        command = 0.98 * command + rng.normal(size=3) * [0.01, 0.01, 0.02]
        after = plant.step(BodyTwist(*command.tolist()), dt).pose
        asked[k], done[k] = command, twist_between(pose, after, dt)
        pose = after
    answers, demands = np.diff(done, axis=0), asked[1:] - done[:-1]
    lags = []
    for axes in (slice(0, 2), slice(2, 3)):
        gain = float((answers[:, axes] * demands[:, axes]).sum() / (demands[:, axes] ** 2).sum())
        if not gain > 0.0:
            raise InvalidInput("the robot does not do what it is asked: no lag explains its motion")
        lags.append(max(dt / gain - dt, 0.0))
    return lags[0], lags[1]
