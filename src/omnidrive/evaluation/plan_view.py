"""Planned motion on its map: what the picture of a plan shows at each point of the path."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.planning import Path
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference import LimitRows
from omnidrive.reference.timing.piecewise_path import rotate_into_body
from omnidrive.robot import Robot

_MOVING = 1e-3
"""Share of the largest speed below which the motion has no direction of travel."""


@dataclass(frozen=True, eq=False)
class PlanView:
    """Planned motion, sampled in time, with its map.

    Attributes:
        robot: The robot.
        obstacles: Occupancy grid of the obstacles.
        free_space: Inflated grid: its free cells may contain the robot's centre.
        grid_path: Cells of the searched path, as poses; None for a motion that is not planned.
        times: Times, s, ascending.
        motion: Setpoints at these times; columns as in :class:`~omnidrive.reference.Reference`.
        clearance: Distance of the robot's body to the nearest obstacle, m; infinite without any.
        limits: Limits of the motion; those of speeds give :attr:`top_speed`.
        costs: Costs, keep-out and speed zones and lanes; None: there are none.
    """

    robot: Robot
    obstacles: OccupancyGrid
    free_space: OccupancyGrid
    grid_path: Path | None
    times: Float[Array, " times"]
    motion: Float[Array, "times 6"]
    clearance: Float[Array, " times"]
    limits: tuple[LimitRows, ...]
    costs: CostMap | None = None

    @cached_property
    def distance(self) -> Float[Array, " times"]:
        """Arc length from the start, m."""
        return cumulative_length(self.motion[:, :2])

    @cached_property
    def speed(self) -> Float[Array, " times"]:
        """Speed of the origin of B, m/s."""
        speed: Float[Array, " times"] = np.hypot(self.motion[:, 3], self.motion[:, 4])
        return speed

    @property
    def curvature(self) -> Float[Array, " times"]:
        """Curvature of the path, 1/m, positive to the left; NaN where the robot does not move.

        It is the difference of the directions of travel at the times before and after, over that of
        the arc lengths.
        """
        found = np.full(len(self.times), np.nan)
        moving = np.flatnonzero(self._moves)
        if len(moving) > 2:
            vx, vy = self.motion[moving, 3:5].T
            direction, distance = np.unwrap(np.arctan2(vy, vx)), self.distance[moving]
            found[moving] = np.gradient(direction, distance)
        return found

    @property
    def top_speed(self) -> Float[Array, " times"]:
        """Largest speed along the path within the limits of speeds and the speed zones, m/s.

        The robot turns in proportion to its speed, as the path asks. Where it does not move, the
        value is that of the nearest points at which it does. Accelerations may need less speed.
        """
        motion, moves = self.motion, self._moves
        body = rotate_into_body(motion[:, 3:6], motion[:, 2]).T
        used = [limit.shares(body) for limit in self.limits if limit.kind == "speed"]
        top = np.full(len(self.times), np.inf)
        if used and moves.any():
            along = self.distance[moves]
            top = np.interp(self.distance, along, self.speed[moves] / np.max(used, axis=0)[moves])
        return top if self.costs is None else np.minimum(top, self.costs.max_speeds(motion[:, :2]))

    @property
    def cost(self) -> Float[Array, " times"] | None:
        """Cost of a metre beyond its length at each point; None without costs."""
        return None if self.costs is None else self.costs.costs_at(self.motion[:, :2])

    @property
    def _moves(self) -> np.ndarray:
        """At which times the motion has a direction of travel."""
        return self.speed > _MOVING * max(float(self.speed.max()), 1e-9)
