"""What an agent sees of a robot that tracks a reference: numbers from -1 to 1."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np
from jaxtyping import Float, Float32

from omnidrive.arrays import Array
from omnidrive.geometry import BodyTwist, Pose, wrap
from omnidrive.reference import Reference

_SAMPLES = 100_000


@dataclass(frozen=True, eq=False, slots=True)
class ObservationModel:
    """Poses and twists in the robot's frame B, each divided by the largest that is told apart.

    In order, ``n`` being :attr:`preview`:

    - 3 numbers: the set point's pose now, as seen from B: x and y by ``lost[0]``, heading by pi;
    - 3: the robot's twist by ``max_twist``;
    - 3: the set point's twist, in B, by ``max_twist``;
    - 3 n: poses of the set points 1 to n samples ahead, as seen from B: the k-th's x and y by
      ``lost[0]`` and what the reference travels in k samples at its fastest, heading by pi;
    - 3: the last action.

    What is larger is cut to -1 or 1.

    Attributes:
        reference: What to track.
        dt: Sample time in s.
        preview: How many set points ahead are seen.
        lost: Errors in m and rad at which a run is lost.
        max_twist: Twist of an action of ones, in m/s, m/s and rad/s.
        top_speed: Of the reference, in m/s.
    """

    reference: Reference
    dt: float
    preview: int
    lost: tuple[float, float]
    max_twist: Float[Array, " 3"]
    top_speed: float

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return 12 + 3 * self.preview

    def observe(
        self, t: float, pose: Pose, twist: BodyTwist, action: Float[Array, " 3"]
    ) -> Float32[Array, " numbers"]:
        """The numbers at ``t`` (s), where the robot is believed to be at ``pose``."""
        ahead = self.reference.window(t, self.preview + 1, self.dt)
        c, s = cos(pose.yaw), sin(pose.yaw)
        into_body = np.array([[c, -s], [s, c]])  # from the right
        reach = self.lost[0] + self.top_speed * self.dt * np.arange(self.preview + 1)
        positions = (ahead[:, :2] - [pose.x, pose.y]) @ into_body / reach[:, None]
        headings = wrap(ahead[:, 2] - pose.yaw) / np.pi
        poses = np.column_stack([positions, headings])
        wanted = np.array([*(ahead[0, 3:5] @ into_body), ahead[0, 5]])
        numbers = np.concatenate(
            [
                poses[0],
                np.array(twist) / self.max_twist,
                wanted / self.max_twist,
                poses[1:].ravel(),
                action,
            ]
        )
        bounded: Float32[Array, " numbers"] = np.clip(numbers, -1.0, 1.0).astype(np.float32)
        return bounded


def top_speed(reference: Reference, dt: float) -> float:
    """The fastest that a reference travels, at its samples of ``dt`` s, in m/s.

    Of a long one at 100,000 samples.
    """
    count = min(round(reference.duration / dt), _SAMPLES) + 1
    rows = reference.window(0.0, count, reference.duration / max(count - 1, 1))
    return float(np.hypot(rows[:, 3], rows[:, 4]).max())
