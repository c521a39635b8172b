"""Occupancy grids, their file formats, and randomly generated maps."""

from omnidrive.choices import Unknown
from omnidrive.maps.ascii import load_ascii_map
from omnidrive.maps.costs import CostMap, Inflation, Lane, load_costs
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.load import is_named_map, load_map
from omnidrive.maps.maze import maze_map
from omnidrive.maps.movingai import load_movingai_map
from omnidrive.maps.nav2 import load_nav2_map, save_nav2_map
from omnidrive.maps.numpy_file import load_numpy_map
from omnidrive.maps.paper import paper_map, paper_wall
from omnidrive.maps.queries import Query, load_queries
from omnidrive.maps.random_maps import random_map, rooms_map, warehouse_map

__all__ = [
    "CostMap",
    "Inflation",
    "Lane",
    "OccupancyGrid",
    "Query",
    "Unknown",
    "is_named_map",
    "load_ascii_map",
    "load_costs",
    "load_map",
    "load_movingai_map",
    "load_nav2_map",
    "load_numpy_map",
    "load_queries",
    "maze_map",
    "paper_map",
    "paper_wall",
    "random_map",
    "rooms_map",
    "save_nav2_map",
    "warehouse_map",
]
