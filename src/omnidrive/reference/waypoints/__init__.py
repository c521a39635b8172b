"""Waypoint files of other programs, in and out."""

from omnidrive.reference.waypoints.waypoint_file import load_waypoints, save_waypoints

__all__ = ["load_waypoints", "save_waypoints"]
