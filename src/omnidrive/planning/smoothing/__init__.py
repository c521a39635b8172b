"""Smoothing of a grid path to a spline that is proved to be free of collisions."""

from omnidrive.planning.smoothing.smooth import SmoothedPath, SmoothingName, smooth

__all__ = ["SmoothedPath", "SmoothingName", "smooth"]
