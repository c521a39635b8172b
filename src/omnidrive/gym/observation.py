"""Observations of the tracking environment: numbers from -1 to 1."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np
from jaxtyping import Float, Float32

from omnidrive.arrays import Array
from omnidrive.geometry import BodyTwist, Pose, wrap
from omnidrive.reference import Reference

_MAX_SAMPLES = 100_000


@dataclass(frozen=True, eq=False, slots=True)
class ObservationModel:
    """Poses and twists in the robot's frame B, each divided by a scale and clipped to -1 and 1.

    In order, with ``n`` = :attr:`preview`:

    - 3 numbers: current reference pose in B; x and y over ``max_error[0]``, heading over pi;
    - 3: twist of the robot over ``max_twist``;
    - 3: reference twist in B over ``max_twist``;
    - 3 n: reference poses 1 to n samples ahead in B; x and y of the k-th over ``max_error[0]`` plus
      the distance that the reference covers in k samples at ``top_speed``, heading over pi;
    - 3: last action.

    Attributes:
        reference: Reference to track.
        dt: Sample time, s.
        preview: Number of future reference poses.
        max_error: Errors in position (m) and heading (rad) that terminate a run.
        max_twist: Twist of an action of ones; m/s, m/s, rad/s.
        top_speed: Largest speed of the reference, m/s.
    """

    reference: Reference
    dt: float
    preview: int
    max_error: tuple[float, float]
    max_twist: Float[Array, " 3"]
    top_speed: float

    @property
    def size(self) -> int:
        """Length of an observation."""
        return 12 + 3 * self.preview

    def observe(
        self, t: float, pose: Pose, twist: BodyTwist, action: Float[Array, " 3"]
    ) -> Float32[Array, " numbers"]:
        """Return the observation at ``t`` (s) from the estimated state and the last action."""
        ahead = self.reference.window(t, self.preview + 1, self.dt)
        c, s = cos(pose.yaw), sin(pose.yaw)
        to_body = np.array([[c, -s], [s, c]])  # for row vectors
        farthest, _ = self.max_error
        scale = farthest + self.top_speed * self.dt * np.arange(self.preview + 1)
        positions = (ahead[:, :2] - [pose.x, pose.y]) @ to_body / scale[:, None]
        headings = wrap(ahead[:, 2] - pose.yaw) / np.pi
        poses = np.column_stack([positions, headings])
        desired = np.array([*(ahead[0, 3:5] @ to_body), ahead[0, 5]])
        numbers = np.concatenate(
            [
                poses[0],
                np.array(twist) / self.max_twist,
                desired / self.max_twist,
                poses[1:].ravel(),
                action,
            ]
        )
        bounded: Float32[Array, " numbers"] = np.clip(numbers, -1.0, 1.0).astype(np.float32)
        return bounded


def top_speed(reference: Reference, dt: float) -> float:
    """Return the largest speed of a reference at samples of ``dt`` (s), m/s.

    A long reference is evaluated at 100,000 samples.
    """
    count = min(round(reference.duration / dt), _MAX_SAMPLES) + 1
    rows = reference.window(0.0, count, reference.duration / max(count - 1, 1))
    return float(np.hypot(rows[:, 3], rows[:, 4]).max())
