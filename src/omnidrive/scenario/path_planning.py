"""Planning of the path of a scenario for the disc about the robot, or for its polygon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from omnidrive.errors import InvalidReference, InvalidWaypoint, NoPathFound
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.planning import FootprintPlan, Plan, Waypoint, plan
from omnidrive.planning.footprint import disc_failure, plan_polygon
from omnidrive.robot import Robot
from omnidrive.scenario.grids import costs_of, grids_of, inflation_of
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.sections import TimingSection

ScenarioPlan = Plan | FootprintPlan


def planned_path(scenario: Scenario, robot: Robot) -> tuple[OccupancyGrid, ScenarioPlan]:
    """Return the map of the obstacles, and the plan of a scenario whose reference is a path.

    The disc about the robot is tried first. A robot with an outline is then planned with its
    polygon, which keeps to the obstacles and keep-out masks themselves; other costs do not affect
    its path.

    Raises:
        InvalidMap: A map cannot be read.
        InvalidWaypoint: The robot would touch an obstacle at start or goal.
        NoPathFound: There is no path between them.
        InvalidReference: Only the polygon has a path, and the timing contradicts its headings.
    """
    assert scenario.start is not None
    assert scenario.goal is not None
    obstacles, grid = grids_of(scenario.map)
    inflation, note = inflation_of(scenario.map, grid, robot)
    without_margin = scenario.map.model_copy(update={"margin": 0.0})
    costs = costs_of(scenario.costs, grid, robot, scenario.timing.max_speed)
    try:
        disc = plan(
            grid,
            scenario.start,
            scenario.goal,
            inflation=inflation,
            options=scenario.path,
            inflation_note=note,
            min_inflation=inflation_of(without_margin, grid, robot)[0],
            costs=costs,
            around_obstacles=None if scenario.costs is None else scenario.costs.around_obstacles,
        )
    except (InvalidWaypoint, NoPathFound) as error:
        if robot.outline is None:
            raise
        reason = disc_failure(robot.body_radius, error)
        found = _polygon_plan(scenario, robot, obstacles, costs, reason)
        return obstacles, found
    if robot.outline is None:
        return obstacles, disc
    return obstacles, FootprintPlan.of_disc(disc, robot.body_radius)


def _polygon_plan(
    scenario: Scenario, robot: Robot, obstacles: OccupancyGrid, costs: CostMap | None, reason: str
) -> FootprintPlan:
    """Return the plan of the polygon; ``reason``: why the disc has none."""
    assert scenario.start is not None
    assert scenario.goal is not None
    if scenario.path.max_curvature or scenario.path.max_curvature_rate:
        raise NoPathFound(
            f"limits of the curvature hold for the disc about the robot only, and {reason}"
        )
    if costs is not None:
        obstacles = replace(obstacles, occupied=obstacles.occupied | costs.kept_out)
        reason += "; of the costs only keep-out masks and speed zones apply to the polygon"
    found = plan_polygon(
        obstacles,
        Waypoint(*scenario.start),
        Waypoint(*scenario.goal),
        footprint=np.array(robot.outline),
        inflation_margin=scenario.map.margin,
        reason=reason,
    )
    _check_timing(scenario.timing)
    return replace(found, costs=costs)


def _check_timing(timing: TimingSection) -> None:
    """Check that the timing keeps the headings of the path, which are those of the polygon."""
    if timing.heading == "path":
        return
    raise InvalidReference(
        "only the polygon of the robot has a path, with headings at which it fits between the "
        f"obstacles; the heading '{timing.heading}' contradicts them: use the heading path"
    )
