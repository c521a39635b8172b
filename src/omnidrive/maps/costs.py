"""Costs of travelling over the cells of a map: inflation, keep-out and speed masks, lanes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidMap, one_line, short_repr
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.geometry.polygon import check_footprint
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.nav2 import load_nav2_grades
from omnidrive.maps.numpy_file import load_numbers

MAX_COST = 250.0
"""Largest cost of a cell."""
_PERCENT, _ABSOLUTE = 1, 2
"""Types of Nav2's speed filters: in percent of the largest speed, and in m/s."""
_LETHAL = 100.0
"""Occupancy, percent, from which a cell of a keep-out mask is not entered."""
_OFFSET = 1e-2
"""Largest offset of a mask from the map, in cells, and largest rotation, rad."""


class Inflation(NamedTuple):
    """Cost around obstacles: ``weight exp(-scaling (d - r))`` at the distance d, 0 from radius on.

    r is the distance that the robot's centre keeps from every obstacle. The decay is that of Nav2's
    inflation layer, with ``radius`` as its ``inflation_radius`` and ``scaling`` as its
    ``cost_scaling_factor``; ``weight`` is the ``cost_travel_multiplier`` of its Smac planner. The
    defaults are wider than Nav2's, so that paths keep to the middle of rooms: a cost that falls
    slowly and about linearly with the distance lengthens a path least for the clearance it gains.
    """

    radius: float = 3.0
    """Distance from obstacles beyond which there is no cost, m."""
    scaling: float = 1.0
    """Decay of the cost, 1/m."""
    weight: float = 2.0
    """Cost at the least distance from obstacles that is possible for the robot."""


class Lane(NamedTuple):
    """Region with a direction of travel: moves against it cost more."""

    polygon: Sequence[tuple[float, float]]
    """Corners (x, y) in W, m."""
    heading: float
    """Direction of travel in W, rad."""
    against: float = 10.0
    """Cost of moves opposite to the direction; half of it across, none along it."""


@dataclass(frozen=True, eq=False)
class CostMap:
    """Costs of travelling over the cells of a grid, and speed limits.

    A metre over a cell costs ``1 + cost`` metres.

    Attributes:
        grid: The map. Cells of keep-out masks are occupied.
        costs: Cost of each cell, 0 to 250.
        max_speed: Largest speed of the robot's centre in each cell, m/s; None: no limit.
        directions: Direction of travel of each cell in W, rad, NaN where there is none; None: no
            lanes.
        against: Cost of moves opposite to the direction.
        forbidden: Cells of keep-out masks; None: none.

    Raises:
        InvalidInput: An array has not the shape of the grid; a cost is negative, above 250 or not a
            number; a speed is not positive. The message lists all faults.
    """

    grid: OccupancyGrid
    costs: Float32[Array, "rows cols"]
    max_speed: Float32[Array, "rows cols"] | None = None
    directions: Float32[Array, "rows cols"] | None = None
    against: float = 0.0
    forbidden: Bool[Array, "rows cols"] | None = None

    def __post_init__(self) -> None:
        shape, faults = self.grid.occupied.shape, []
        arrays = {"costs": self.costs, "max_speed": self.max_speed, "directions": self.directions}
        for name, array in arrays.items():
            if array is not None and np.shape(array) != shape:
                faults.append(f"{name} has the shape {np.shape(array)}, the map {shape}")
        with np.errstate(invalid="ignore"):
            wrong = int(np.count_nonzero(~((self.costs >= 0.0) & (self.costs <= MAX_COST))))
            if wrong:
                faults.append(f"{wrong} costs are not numbers from 0 to {MAX_COST:g}")
            if self.max_speed is not None and not (self.max_speed > 0.0).all():
                faults.append("a largest speed is not a positive number")
        if not 0.0 <= self.against <= MAX_COST:
            faults.append(f"the cost against lanes is {self.against}, need 0 to {MAX_COST:g}")
        if faults:
            raise InvalidInput("; ".join(faults))

    @classmethod
    def of(cls, grid: OccupancyGrid) -> CostMap:
        """Return the costs of a map without costs: all 0."""
        return cls(grid, np.zeros(grid.occupied.shape, np.float32))

    def with_inflation(self, distance: float, inflation: Inflation | None = None) -> CostMap:
        """Add the cost around obstacles; the larger of both costs of a cell counts, as in Nav2.

        Args:
            distance: Distance that the robot's centre keeps from every obstacle, m.
            inflation: Extent and decay of the cost.

        Raises:
            InvalidInput: A number is negative or not finite, or the weight is above 250.
        """
        radius, scaling, weight = inflation or Inflation()
        if not all(isfinite(x) and x >= 0.0 for x in (distance, radius, scaling, weight)):
            raise InvalidInput(
                "inflation needs a distance, a radius, a scaling and a weight of 0 or more, got "
                f"{distance:g} m, {radius:g} m, {scaling:g} 1/m, {weight:g}"
            )
        if weight > MAX_COST:
            raise InvalidInput(f"the weight of the inflation is {weight:g}, need 0 to {MAX_COST:g}")
        away = self.grid.centre_distances(radius)
        around = weight * np.exp(-scaling * np.maximum(away - np.float32(distance), 0.0))
        around[away >= radius] = 0.0
        return replace(self, costs=np.maximum(self.costs, around.astype(np.float32)))

    def with_costs(self, costs: Float[Array, "rows cols"]) -> CostMap:
        """Add own costs, an array of the shape of the grid; row 0 is the lowest."""
        if np.shape(costs) != self.costs.shape:
            raise InvalidInput(
                f"costs have the shape {np.shape(costs)}, but the map {self.costs.shape}"
            )
        return replace(self, costs=(self.costs + costs).astype(np.float32))

    def with_keepout(self, path: StrPath, weight: float = 2.0) -> CostMap:
        """Add a keep-out mask of Nav2 (filter type 0): a map file of any mode.

        Cells of 100 percent are occupied; grades below cost ``weight`` times their share, so that a
        graded mask marks regions to avoid. Unknown cells have no effect.

        Raises:
            InvalidMap: The mask cannot be read, or its size or frame is not that of the map.
        """
        path = to_path(path)
        known = np.nan_to_num(_grades_on(self.grid, path), nan=0.0)
        forbidden = known >= _LETHAL
        grid = replace(self.grid, occupied=self.grid.occupied | forbidden)
        share = np.where(forbidden, 0.0, known / _LETHAL)
        costs = (self.costs + np.float32(weight) * share).astype(np.float32)
        return replace(self, grid=grid, costs=costs, forbidden=self.kept_out | forbidden)

    def with_speed_mask(self, path: StrPath, top: float) -> CostMap:
        """Add a speed mask of Nav2: ``limit = base + multiplier * percent`` of every cell.

        ``type`` (1: the limit is in percent of the largest speed, 2: in m/s), ``base`` and
        ``multiplier`` are those of Nav2's filter info, and stand in the YAML file of the mask, by
        default 1, 100 and -1. Cells of 0 percent or unknown have no limit.

        Args:
            path: The YAML file of the mask.
            top: Largest speed of the robot, m/s, to which percents refer.

        Raises:
            InvalidMap: As for :meth:`with_keepout`, or the type or a limit is not possible.
        """
        name = one_line(str(to_path(path)))
        kind, base, multiplier = _filter_info(path, name)
        grades = _grades_on(self.grid, path)
        limited = grades > 0.0
        limits = np.float32(base) + np.float32(multiplier) * grades
        if kind == _PERCENT:
            if (limits[limited] > 100.0).any():
                raise InvalidMap(f"{name}: a speed limit is above 100 % of the largest speed")
            limits *= np.float32(top / 100.0)
        if not (limits[limited] > 0.0).all():
            raise InvalidMap(
                f"{name}: a speed limit is 0 or negative: {base:g} + {multiplier:g} * percent"
            )
        found = np.where(limited, limits, np.float32(np.inf)).astype(np.float32)
        before = self.max_speed
        return replace(self, max_speed=found if before is None else np.minimum(found, before))

    def with_lanes(self, lanes: Sequence[Lane]) -> CostMap:
        """Add one-way lanes; the last of overlapping ones counts.

        Raises:
            InvalidInput: A polygon has no area, a heading is not finite, or lanes differ in their
                cost ``against``.
        """
        if not lanes:
            return self
        costs = {float(lane.against) for lane in lanes}
        if len(costs) > 1:
            raise InvalidInput("all lanes of a map need the same cost 'against'")
        before = self.directions
        directions = (
            np.full(self.costs.shape, np.nan, np.float32) if before is None else before.copy()
        )
        for lane in lanes:
            if not isfinite(lane.heading):
                raise InvalidInput(f"the heading of a lane must be finite, got {lane.heading} rad")
            directions[cells_in(self.grid, np.array(lane.polygon, float))] = lane.heading
        return replace(self, directions=directions, against=costs.pop())

    @cached_property
    def kept_out(self) -> Bool[Array, "rows cols"]:
        """Cells that a keep-out mask occupies."""
        return self.forbidden if self.forbidden is not None else np.zeros(self.costs.shape, bool)

    @cached_property
    def is_plain(self) -> bool:
        """Whether no cell has a cost or a lane."""
        return not (self.costs.any() or (self.directions is not None and self.against > 0.0))

    def max_speeds(self, points: Float[Array, "points 2"]) -> Float[Array, " points"]:
        """Return the speed limit at points (x, y) in W, in m/s; infinite where there is none."""
        if self.max_speed is None:
            return np.full(len(points), np.inf)
        return self._values_at(self.max_speed, points, np.inf)

    def costs_at(self, points: Float[Array, "points 2"]) -> Float[Array, " points"]:
        """Return the cost of the cells of points (x, y) in W; 0 outside the map."""
        return self._values_at(self.costs, points, 0.0)

    def _values_at(
        self, values: Float32[Array, "rows cols"], points: Float[Array, "points 2"], outside: float
    ) -> Float[Array, " points"]:
        """Return the values of the cells of points, and ``outside`` beyond the map."""
        cells = self.grid.cells_of(points)
        last = np.array(values.shape) - 1
        within = ((cells >= 0) & (cells <= last)).all(axis=1)
        row, col = cells.clip(0, last).T
        found: Float[Array, " points"] = np.where(within, values[row, col].astype(float), outside)
        return found


def load_costs(path: StrPath, grid: OccupancyGrid) -> Float32[Array, "rows cols"]:
    """Read the costs of the cells of a map from a NumPy file (.npy); row 0 is the lowest.

    Raises:
        InvalidMap: The file is missing, malformed or too large, has another shape than the map, or
            contains a number that is negative, above 250 or NaN.
    """
    name = one_line(str(to_path(path)))
    costs = load_numbers(path)
    if costs.shape != grid.occupied.shape:
        raise InvalidMap(f"{name} has the shape {costs.shape}, the map {grid.occupied.shape}")
    with np.errstate(invalid="ignore"):
        wrong = int(np.count_nonzero(~((costs >= 0.0) & (costs <= MAX_COST))))
    if wrong:
        raise InvalidMap(f"{name}: {wrong} of the costs are not numbers from 0 to {MAX_COST:g}")
    return costs.astype(np.float32)


def cells_in(grid: OccupancyGrid, polygon: Float[Array, "corners 2"]) -> Bool[Array, "rows cols"]:
    """Return the cells whose centres lie in a polygon (corners (x, y) in W, m), by even-odd rule.

    Raises:
        InvalidInput: The polygon has fewer than three corners, one that is not finite, or no area.
    """
    check_footprint(polygon)
    rows, cols = grid.occupied.shape
    corners = grid._in_cells(polygon)
    ends = np.roll(corners, -1, axis=0)
    inside = np.zeros((rows, cols), bool)
    v, u = np.arange(rows)[:, None] + 0.5, np.arange(cols)[None] + 0.5
    for (v0, u0), (v1, u1) in zip(corners, ends, strict=True):
        if v0 != v1:
            crosses = (v0 > v) != (v1 > v)
            inside ^= crosses & (u < u0 + (v - v0) * (u1 - u0) / (v1 - v0))
    return inside


def _grades_on(grid: OccupancyGrid, path: StrPath) -> Float32[Array, "rows cols"]:
    """Return the grades of a mask, which must have the size and the frame of the map."""
    name = one_line(str(to_path(path)))
    frame, grades = load_nav2_grades(path)
    faults = []
    if grades.shape != grid.occupied.shape:
        rows, cols = grid.occupied.shape
        faults.append(f"has {grades.shape[1]} x {grades.shape[0]} cells, the map {cols} x {rows}")
    if abs(frame.resolution - grid.resolution) > 1e-6 * grid.resolution:
        faults.append(f"has cells of {frame.resolution:g} m, the map of {grid.resolution:g} m")
    away = np.hypot(*np.subtract(frame.origin, grid.origin))
    if away > _OFFSET * grid.resolution or abs(frame.yaw - grid.yaw) > _OFFSET:
        faults.append(
            f"has the origin {(*frame.origin, frame.yaw)}, the map {(*grid.origin, grid.yaw)}"
        )
    if faults:
        raise InvalidMap(f"{name}: the mask {', '.join(faults)}; draw the mask on the map")
    return grades


def _filter_info(path: StrPath, name: str) -> tuple[int, float, float]:
    """Return type, base and multiplier of a speed filter."""
    meta = read_yaml(to_path(path), "mask", InvalidMap)
    given = meta if isinstance(meta, dict) else {}
    kind, base, multiplier = (
        given.get(key, value) for key, value in (("type", 1), ("base", 100.0), ("multiplier", -1.0))
    )
    if kind not in (_PERCENT, _ABSOLUTE):
        raise InvalidMap(
            f"{name}: the type of a speed mask is 1 (percent) or 2 (m/s), got {short_repr(kind)}"
        )
    for key, value in (("base", base), ("multiplier", multiplier)):
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
            raise InvalidMap(f"{name}: {key} must be a number, got {short_repr(value)}")
    return kind, float(base), float(multiplier)
