"""From a map to a path: geometry only, no time."""

from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.plan import PathOptions, Plan, Waypoint, plan
from omnidrive.planning.search import GridSearch, HeuristicName, MethodName, SearchResult, search
from omnidrive.planning.smoothing import Smoothed, SmoothingName, smooth

__all__ = [
    "GridSearch",
    "HeuristicName",
    "MethodName",
    "Path",
    "PathOptions",
    "Plan",
    "SearchResult",
    "Smoothed",
    "SmoothingName",
    "SplinePath",
    "Waypoint",
    "plan",
    "search",
    "smooth",
]
