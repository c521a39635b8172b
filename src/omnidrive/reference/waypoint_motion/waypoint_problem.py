"""Problem of minimum time through waypoints, as a file states it."""

from __future__ import annotations

from dataclasses import dataclass, field

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint


@dataclass(frozen=True, slots=True)
class MotionProblem:
    """Arguments of :func:`minimum_time_through`.

    Attributes:
        waypoints: The waypoints.
        sections: Constraints between them.
        guess: Poses of a known motion from each waypoint to the next, both included, one array for
            each leg; x and y in m, yaw in rad. Empty: none is known.
    """

    waypoints: tuple[MotionWaypoint, ...]
    sections: tuple[MotionSection, ...]
    guess: tuple[Float[Array, "poses 3"], ...] = field(default=(), compare=False)
