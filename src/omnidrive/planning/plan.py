"""Planned paths: start and goal, options and results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np

from omnidrive.choices import HeuristicName, MethodName, SmoothingName
from omnidrive.errors import InvalidInput
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.notebook import facts_html
from omnidrive.parameter import Bounds, check_choice
from omnidrive.planning.drawing import path_svg
from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.search import SearchResult
from omnidrive.planning.smoothing.fairing import NO_LIMITS, CurvatureLimits

PlanStatus = Literal["complete", "not smoothed", "not optimal"]
"""How far a plan with a time limit got."""
_DRAWN = 300  # points of the path in notebooks


class Waypoint(NamedTuple):
    """Start or goal: x, y in m, yaw in rad; a yaw of None leaves the heading to the path."""

    x: float
    """Position in W, m."""
    y: float
    """Position in W, m."""
    yaw: Annotated[float, Bounds(-6.3, 6.3, "rad")] | None = None
    """Heading in W, rad."""

    def plain(self) -> list[float]:
        """Return the value of a scenario that describes the waypoint."""
        return [each for each in self if each is not None]


@dataclass(frozen=True, slots=True)
class PathOptions:
    """Options of the search and the smoothing; the defaults suit every map.

    Attributes:
        search: Search method, see :func:`~omnidrive.planning.search`.
        heuristic: Heuristic of the search; None for the default of the method.
        cut_corners: Allow diagonal moves past occupied cells.
        smooth: Smoothing method, see :func:`~omnidrive.planning.smooth`.
        turn_within: Distance over which the heading turns from that of the start to the direction
            of the path, and from there to that of the goal, in m; 0 turns between two control
            points.
        max_curvature: Largest curvature of a certified path, 1/m; None: no limit.
        max_curvature_rate: Largest change of the curvature with the distance, 1/m^2; None: no
            limit.

    Raises:
        InvalidInput: A name is unknown, ``smooth`` is certified and ``cut_corners`` is true, or the
            curvature is limited and ``smooth`` is not certified.
    """

    search: MethodName = "astar"
    heuristic: HeuristicName | None = None
    cut_corners: bool = False
    smooth: SmoothingName = "certified"
    turn_within: Annotated[float, Bounds(0.0, 10.0, "m")] = 1.0
    max_curvature: Annotated[float, Bounds(0.001, 1e4, "1/m")] | None = None
    max_curvature_rate: Annotated[float, Bounds(0.001, 1e6, "1/m^2")] | None = None

    def __post_init__(self) -> None:
        check_choice("search method", self.search, get_args(MethodName))
        if self.heuristic is not None:
            check_choice("heuristic", self.heuristic, get_args(HeuristicName))
        check_choice("smoothing method", self.smooth, get_args(SmoothingName))
        if self.cut_corners and self.smooth == "certified":
            raise InvalidInput(
                "cannot be certified if it cuts corners, because it then touches obstacles; use "
                "smooth: spline or cut_corners: false"
            )
        if self.curvature_limits != NO_LIMITS and self.smooth != "certified":
            raise InvalidInput("limits of the curvature need smooth: certified")

    @property
    def curvature_limits(self) -> CurvatureLimits:
        """Limits of the curvature, 1/m and 1/m^2."""
        return CurvatureLimits(self.max_curvature or np.inf, self.max_curvature_rate or np.inf)


@dataclass(frozen=True, eq=False, slots=True)
class Plan:
    """Planned path with the intermediate results.

    Attributes:
        search_result: Result of the grid search.
        grid_path: Cells found by the search, as poses from the start to the goal.
        spline: The smoothed path.
        free_space: The inflated map, whose free cells the robot's centre may enter.
        clearance: Proved lower bound on the distance in m from ``spline`` to the occupied cells of
            ``free_space``. If the spline may enter one, it is negative: minus the greatest
            possible depth.
        grid: The map.
        costs: Costs of the cells, None: none.
        status: ``complete``; with a time limit also ``not smoothed``, if the smoothing did not end,
            or ``not optimal``, if the search did not end.
        suboptimality: Greatest possible ratio of the cost of the grid path to the least, if the
            time limit ended the search; 1 otherwise.
    """

    search_result: SearchResult
    grid_path: Path
    spline: SplinePath
    free_space: OccupancyGrid
    clearance: float
    grid: OccupancyGrid
    costs: CostMap | None = None
    status: PlanStatus = "complete"
    suboptimality: float = 1.0

    def _repr_html_(self) -> str:
        """Return drawing and main results for notebooks."""
        facts = {
            "grid path": f"{self.grid_path.length:.3f} m, {len(self.grid_path.poses)} cells",
            "smooth path": f"{self.spline.length:.3f} m",
            "clearance": f"at least {self.clearance:.3f} m from the inflated obstacles",
            "search": f"{self.search_result.expansions} expansions",
        }
        positions = self.spline.poses(np.linspace(0.0, 1.0, _DRAWN))[:, :2]
        return facts_html("Plan", facts, path_svg(self.grid, positions))
