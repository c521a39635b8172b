"""Smoothing: from the polygon that a search found to a spline that is proved to hit nothing."""

from omnidrive.planning.smoothing.smooth import Smoothed, SmoothingName, smooth

__all__ = ["Smoothed", "SmoothingName", "smooth"]
