"""Path planning on occupancy grids: grid search, smoothing and geometric paths without time."""

from omnidrive.choices import HeuristicName, MethodName, SmoothingName
from omnidrive.planning.footprint import FootprintPlan, footprint_clearance, plan_footprint
from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.plan import PathOptions, Plan, Waypoint
from omnidrive.planning.planner import Planner, plan
from omnidrive.planning.search import GridSearch, SearchResult, search
from omnidrive.planning.smoothing import SmoothedPath, smooth

__all__ = [
    "FootprintPlan",
    "GridSearch",
    "HeuristicName",
    "MethodName",
    "Path",
    "PathOptions",
    "Plan",
    "Planner",
    "SearchResult",
    "SmoothedPath",
    "SmoothingName",
    "SplinePath",
    "Waypoint",
    "footprint_clearance",
    "plan",
    "plan_footprint",
    "search",
    "smooth",
]
