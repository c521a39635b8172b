"""Readers and writers of waypoint files of other programs."""

from omnidrive.reference.waypoints.waypoint_file import load_waypoints, save_waypoints

__all__ = ["load_waypoints", "save_waypoints"]
