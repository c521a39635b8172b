"""Path of a reference, without its times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.maps import OccupancyGrid
from omnidrive.reference.reference import Reference

_SAMPLES = 4001


@dataclass(frozen=True, eq=False)
class ReferencePath:
    """Path of a reference as a polyline through its poses at equal times.

    Attributes:
        samples: Poses of B in W; x and y in m, yaw in rad, unwrapped.
    """

    samples: Float[Array, "samples 3"]

    @classmethod
    def of(cls, reference: Reference) -> ReferencePath:
        """Sample the path of a reference at 4001 times."""
        step = reference.duration / (_SAMPLES - 1)
        return cls(reference.window(0.0, _SAMPLES, step)[:, :3])

    def poses(self, u: float | Float[Array, "*n"]) -> Float[Array, "*n 3"]:
        """Return the poses at shares ``u`` of the duration, from 0 to 1."""
        at = np.linspace(0.0, 1.0, len(self.samples))
        columns = [np.interp(u, at, column) for column in self.samples.T]
        poses: Float[Array, "*n 3"] = np.stack(columns, axis=-1)
        return poses

    @cached_property
    def _steps(self) -> Float[Array, " steps"]:
        steps: Float[Array, " steps"] = np.linalg.norm(np.diff(self.samples[:, :2], axis=0), axis=1)
        return steps

    @property
    def length(self) -> float:
        """Length of the polyline through the positions, in m."""
        return float(self._steps.sum())

    def clearance(self, grid: OccupancyGrid) -> tuple[float, float]:
        """Return bounds on the least distance in m from the path to an occupied cell.

        The upper bound is the least distance of a sample. A point of the polyline is at most half a
        step from a sample, which gives the lower bound. Infinite without occupied cells.
        """
        minimum = float(grid.clearance(self.samples[:, :2]).min())
        return minimum - 0.5 * float(self._steps.max()), minimum
