"""Planning with the polygon of the robot at each heading."""

from omnidrive.geometry.polygon import Polygon
from omnidrive.planning.footprint.clearance import footprint_clearance, unproved_pieces
from omnidrive.planning.footprint.plan_footprint import (
    FootprintPlan,
    disc_failure,
    plan_footprint,
    plan_polygon,
)
from omnidrive.planning.footprint.pose_distance import pose_distance
from omnidrive.planning.footprint.pose_search import (
    CellPose,
    PoseSearch,
    PoseSearchResult,
    search_poses,
)

__all__ = [
    "CellPose",
    "FootprintPlan",
    "Polygon",
    "PoseSearch",
    "PoseSearchResult",
    "disc_failure",
    "footprint_clearance",
    "plan_footprint",
    "plan_polygon",
    "pose_distance",
    "search_poses",
    "unproved_pieces",
]
