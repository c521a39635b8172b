"""Planning with the polygon of the robot at each heading."""

from omnidrive.planning.footprint.clearance import footprint_clearance
from omnidrive.planning.footprint.plan_footprint import FootprintPlan, plan_footprint
from omnidrive.planning.footprint.polygon import Polygon
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
    "footprint_clearance",
    "plan_footprint",
    "search_poses",
]
