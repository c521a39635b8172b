"""A scenario of a robot with an outline between two rooms."""

import numpy as np
import yaml

from omnidrive.maps import OccupancyGrid, save_nav2_map

BOX = [[0.254, 0.215], [-0.254, 0.215], [-0.254, -0.215], [0.254, -0.215]]


def write_door(folder, door=0.5, outline=BOX, margin=0.02, **changes):
    """Write a scenario with a door of a width in m, with changed sections; return its path."""
    occupied = np.zeros((60, 80), bool)
    half = round(0.5 * door / 0.05)
    occupied[:, 39:42] = True
    occupied[30 - half : 30 + half, 39:42] = False
    save_nav2_map(OccupancyGrid(occupied, 0.05), folder / "map.yaml")
    data = {
        "format": "omnidrive-scenario-1",
        "name": "door",
        "robot": {"name": "mecanum"} | ({"outline": outline} if outline else {}),
        "map": {"source": "map.yaml", "margin": margin},
        "start": [1.0, 0.8, 0.0],
        "goal": [3.0, 2.3, 1.5708],
        "timing": {"law": "limits"},
        "plant": {"type": "mujoco-balls"},
        "controllers": {"nmpc": {"type": "holonomic-nmpc"}},
        "tasks": {"track": {"durations": [8.0]}},
    }
    (folder / "door.yaml").write_text(yaml.safe_dump(data | changes), encoding="utf-8")
    return folder / "door.yaml"
