"""Planning of the path of a scenario for the disc about the robot, or for its polygon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from omnidrive.errors import InvalidReference, InvalidWaypoint, NoPathFound, NoPathYet
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.planning import FootprintPlan, Plan, Planner, Waypoint
from omnidrive.planning.footprint import disc_failure, plan_polygon
from omnidrive.robot import Robot
from omnidrive.scenario.grids import costs_of, grids_of, inflation_of
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.sections import TimingSection

ScenarioPlan = Plan | FootprintPlan


def planned_path(
    scenario: Scenario, robot: Robot, time_limit: float | None = None
) -> tuple[OccupancyGrid, ScenarioPlan]:
    """Return the map of the obstacles, and the plan of a scenario whose reference is a path.

    The disc about the robot is tried first. A robot with an outline is then planned with its
    polygon, which keeps to the obstacles and keep-out masks themselves; other costs do not affect
    its path.

    Args:
        scenario: The scenario.
        robot: Its robot.
        time_limit: Time for search and smoothing of each shape, in s; None: no limit.

    Raises:
        InvalidMap: A map cannot be read.
        InvalidWaypoint: The robot would touch an obstacle at start or goal.
        NoPathFound: There is no path between them.
        NoPathYet: There is none within the time limit.
        InvalidInput: The time limit is not positive, or the search does not support one.
        InvalidReference: Only the polygon has a path, and the timing contradicts its headings.
    """
    assert scenario.start is not None
    assert scenario.goal is not None
    obstacles, grid = grids_of(scenario.map)
    inflation, note = inflation_of(scenario.map, grid, robot)
    without_margin = scenario.map.model_copy(update={"margin": 0.0})
    costs = costs_of(scenario.costs, grid, robot, scenario.timing.max_speed)
    try:
        disc = Planner(
            grid,
            inflation=inflation,
            options=scenario.path,
            inflation_note=note,
            min_inflation=inflation_of(without_margin, grid, robot)[0],
            costs=costs,
            around_obstacles=None if scenario.costs is None else scenario.costs.around_obstacles,
        ).plan(scenario.start, scenario.goal, time_limit=time_limit)
    except NoPathYet:
        raise
    except (InvalidWaypoint, NoPathFound) as error:
        if robot.outline is None:
            raise
        reason = disc_failure(robot.body_radius, error)
        found = _polygon_plan(scenario, robot, obstacles, costs, reason, time_limit)
        return obstacles, found
    if robot.outline is None:
        return obstacles, disc
    return obstacles, FootprintPlan.of_disc(disc, robot.body_radius)


def _polygon_plan(  # noqa: PLR0917
    scenario: Scenario,
    robot: Robot,
    obstacles: OccupancyGrid,
    costs: CostMap | None,
    reason: str,
    time_limit: float | None,
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
        time_limit=time_limit,
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
