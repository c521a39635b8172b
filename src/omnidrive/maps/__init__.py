"""Where the robot may be: occupancy grids and the files they come from."""

from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.nav2 import load_nav2_map, save_nav2_map
from omnidrive.maps.paper import paper_map, paper_wall

__all__ = ["OccupancyGrid", "load_nav2_map", "paper_map", "paper_wall", "save_nav2_map"]
