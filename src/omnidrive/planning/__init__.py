"""From a map to a path: geometry only, no time."""

from omnidrive.planning.path import Path, SplinePath

__all__ = ["Path", "SplinePath"]
