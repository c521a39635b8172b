"""Smoothing of a grid path to a spline that is proved to be free of collisions."""

from omnidrive.planning.smoothing.smooth import SmoothedPath, smooth

__all__ = ["SmoothedPath", "smooth"]
