"""Minimum-time motions through waypoints, with constraints between them."""

from omnidrive.reference.waypoint_motion.minimum_time_through import (
    WaypointMotion,
    minimum_time_through,
)
from omnidrive.reference.waypoint_motion.regions import Disc, Polygon
from omnidrive.reference.waypoint_motion.waypoint import MotionWaypoint, Section

__all__ = [
    "Disc",
    "MotionWaypoint",
    "Polygon",
    "Section",
    "WaypointMotion",
    "minimum_time_through",
]
