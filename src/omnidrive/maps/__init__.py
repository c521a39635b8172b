"""Where the robot may be: occupancy grids and the files they come from."""

from omnidrive.maps.grid import OccupancyGrid

__all__ = ["OccupancyGrid"]
