"""Section of a scenario: costs of travelling over the map, keep-out and speed zones, lanes."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from omnidrive.maps import Inflation
from omnidrive.maps.costs import MAX_COST
from omnidrive.parameter import Bounds
from omnidrive.scenario.section import Section

_Point = tuple[Annotated[float, Bounds(-1e5, 1e5, "m")], Annotated[float, Bounds(-1e5, 1e5, "m")]]
_DEFAULT = Inflation()


class LaneSection(Section):
    """Region with a direction of travel."""

    polygon: Annotated[tuple[_Point, ...], Field(min_length=3, max_length=1000)]
    """Corners (x, y) in W, m."""
    heading: Annotated[float, Bounds(-6.3, 6.3, "rad")]
    """Direction of travel in W, rad."""
    against: Annotated[float, Bounds(0.0, MAX_COST, "1")] = 10.0
    """Cost of a metre against the direction, in metres; half of it across. The same for all
    lanes."""


class CostSection(Section):
    """Costs of a planned path: a metre over a cell of cost c counts as 1 + c metres.

    The path minimises length and cost together. The search is `astar`.
    """

    radius: Annotated[float, Bounds(0.0, 100.0, "m")] = _DEFAULT.radius
    """Distance from obstacles beyond which they cause no cost, m; Nav2's `inflation_radius`."""
    scaling: Annotated[float, Bounds(0.0, 1000.0, "1/m")] = _DEFAULT.scaling
    """Exponential decay of the cost with the distance, 1/m; Nav2's `cost_scaling_factor`."""
    weight: Annotated[float, Bounds(0.0, MAX_COST, "1")] = _DEFAULT.weight
    """Cost where the robot is as near to an obstacle as it may be; 0: the shortest path."""
    keepout: str | None = None
    """Keep-out mask: a Nav2 map file (.yaml) of the size and frame of the map. Cells of 100 percent
    are not entered, grades below cost up to 2. In a scenario file, its path is relative to that
    file."""
    speed: str | None = None
    """Speed mask, likewise, with the keys `type` (1: percent, 2: m/s), `base` and `multiplier` of
    Nav2's filter info in its file: the limit is base + multiplier * percent. For the timing
    `limits`."""
    costs: str | None = None
    """Own costs of the cells: a NumPy file (.npy) of the shape of the map, row 0 lowest."""
    lanes: Annotated[tuple[LaneSection, ...], Field(max_length=1000)] = ()
    """One-way lanes."""

    @property
    def around_obstacles(self) -> Inflation | None:
        """Cost around obstacles; None: none."""
        given = Inflation(self.radius, self.scaling, self.weight)
        return given if self.weight > 0.0 and self.radius > 0.0 else None

    @model_validator(mode="after")
    def _check_lanes(self) -> CostSection:
        if len({lane.against for lane in self.lanes}) > 1:
            raise ValueError("lanes: all of them need the same value of 'against'")
        return self
