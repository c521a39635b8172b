"""From a map to a path: geometry only, no time."""

from omnidrive.planning.path import Path, SplinePath
from omnidrive.planning.plan import PathOptions, Place, plan
from omnidrive.planning.search import search
from omnidrive.planning.smoothing import Smoothed, smooth

__all__ = ["Path", "PathOptions", "Place", "Smoothed", "SplinePath", "plan", "search", "smooth"]
