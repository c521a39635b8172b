"""From a map to a path: geometry only, no time."""

from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.plan import PathOptions, Place, plan
from omnidrive.planning.search import search

__all__ = ["Path", "PathOptions", "Place", "SplinePath", "plan", "search"]
