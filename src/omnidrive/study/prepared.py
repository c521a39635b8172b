"""A scenario with its map read, its path planned and its demands checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from jaxtyping import Float

from omnidrive.maps import OccupancyGrid, load_nav2_map, paper_map, paper_wall
from omnidrive.planning import Path, SplinePath, plan
from omnidrive.reference import UniformReference, time_uniformly
from omnidrive.robot import Robot, named_robot
from omnidrive.study.scenario import Scenario

Array = np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class Prepared:
    """What every run of a study shares.

    Attributes:
        scenario: The demand.
        robot: The robot named in it.
        obstacles: What the robot's body must not touch.
        keepout: Where its centre must not be.
        path: Cells found by the search, as poses.
        spline: The smoothed path.
    """

    scenario: Scenario
    robot: Robot
    obstacles: OccupancyGrid
    keepout: OccupancyGrid
    path: Path
    spline: SplinePath

    def clearance(self, points: Float[Array, "points 2"]) -> float:
        """Least distance in m between the robot's body and an obstacle, centred on ``points``."""
        return float(self.obstacles.clearance(points).min()) - self.robot.body_radius

    def reference(self, duration: float) -> UniformReference:
        """The path in ``duration`` seconds."""
        return UniformReference(self.spline, duration)


def lay_out(scenario: Scenario) -> Prepared:
    """Read the map and plan the path.

    Raises:
        InvalidMap: The map cannot be read.
        InvalidPlace: The robot cannot stand at start or goal.
        NoPathFound: There is no way between them.
        InvalidInput: There is no such robot.
    """
    robot = named_robot(scenario.robot.name, assumed_arm=scenario.robot.assumed_arm)
    if scenario.map.source == "paper":
        obstacles, grid, inflation = paper_wall(), paper_map(), scenario.map.margin
    else:
        obstacles = grid = load_nav2_map(FilePath(scenario.map.source))
        inflation = robot.body_radius + scenario.map.margin
    path, spline = plan(
        grid, scenario.start, scenario.goal, inflation=inflation, options=scenario.path
    )
    return Prepared(scenario, robot, obstacles, grid.inflated(inflation), path, spline)


def prepare(scenario: Scenario) -> Prepared:
    """As :func:`lay_out`, and check that the robot can follow the path in every duration.

    Raises:
        InvalidReference: A duration is too short for the wheels; the message says which is not.
    """
    prepared = lay_out(scenario)
    for duration in scenario.tasks.following:
        time_uniformly(prepared.spline, duration, prepared.robot.chassis)
    return prepared
