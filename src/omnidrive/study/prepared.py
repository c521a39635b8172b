"""A scenario with its map read, its path planned and its demands checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath

from omnidrive.maps import OccupancyGrid, load_nav2_map, paper_map
from omnidrive.planning import Path, SplinePath, plan
from omnidrive.reference import UniformReference, time_uniformly
from omnidrive.robot import Robot, named_robot
from omnidrive.study.scenario import Scenario


@dataclass(frozen=True, eq=False, slots=True)
class Prepared:
    """What every run of a study shares.

    Attributes:
        scenario: The demand.
        robot: The robot named in it.
        grid: The obstacles.
        inflation: Distance in m that the planned path keeps from them.
        path: Cells found by the search, as poses.
        spline: The smoothed path.
    """

    scenario: Scenario
    robot: Robot
    grid: OccupancyGrid
    inflation: float
    path: Path
    spline: SplinePath

    @property
    def body_radius(self) -> float:
        """Part of ``inflation`` that the robot's body takes up, in m."""
        return self.inflation - self.scenario.map.margin

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
        grid, body = paper_map(), 0.0
    else:
        grid, body = load_nav2_map(FilePath(scenario.map.source)), robot.body_radius
    inflation = body + scenario.map.margin
    path, spline = plan(
        grid, scenario.start, scenario.goal, inflation=inflation, options=scenario.path
    )
    return Prepared(scenario, robot, grid, inflation, path, spline)


def prepare(scenario: Scenario) -> Prepared:
    """As :func:`lay_out`, and check that the robot can follow the path in every duration.

    Raises:
        InvalidReference: A duration is too short for the wheels; the message says which is not.
    """
    prepared = lay_out(scenario)
    for duration in sorted(_durations(scenario)):
        time_uniformly(prepared.spline, duration, prepared.robot.chassis)
    return prepared


def _durations(scenario: Scenario) -> set[float]:
    tasks = scenario.tasks
    durations: set[float] = set()
    for task in (tasks.track, tasks.noise):
        durations.update(task.durations if task else ())
    return durations | ({tasks.horizon.duration} if tasks.horizon else set())
