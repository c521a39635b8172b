"""Planning with the polygon of the robot at each heading."""

from omnidrive.planning.footprint.polygon import Polygon
from omnidrive.planning.footprint.pose_search import (
    CellPose,
    PoseSearch,
    PoseSearchResult,
    search_poses,
)

__all__ = ["CellPose", "Polygon", "PoseSearch", "PoseSearchResult", "search_poses"]
