"""Minimum-time motions through waypoints, with constraints between them."""

from omnidrive.reference.waypoint_motion.minimum_time_through import (
    WaypointMotion,
    minimum_time_through,
)
from omnidrive.reference.waypoint_motion.motion_problem import load_motion_problem
from omnidrive.reference.waypoint_motion.regions import ConvexPolygon, Disc
from omnidrive.reference.waypoint_motion.waypoint import MotionSection, MotionWaypoint
from omnidrive.reference.waypoint_motion.waypoint_problem import MotionProblem

__all__ = [
    "ConvexPolygon",
    "Disc",
    "MotionProblem",
    "MotionSection",
    "MotionWaypoint",
    "WaypointMotion",
    "load_motion_problem",
    "minimum_time_through",
]
