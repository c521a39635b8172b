"""A scenario with its map read, its path planned and its demands checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path as FilePath

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid, load_map, paper_map, paper_wall
from omnidrive.planning import Plan, SplinePath, plan
from omnidrive.reference import (
    MotionLimits,
    Reference,
    TimedReference,
    minimum_time,
    shortest_duration,
    time_uniformly,
    time_within_limits,
)
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances import Schedule
from omnidrive.study.scenario import Scenario, robot_of


@dataclass(frozen=True, eq=False, slots=True)
class PlannedScenario:
    """What every run of a study shares.

    Attributes:
        scenario: The demand.
        robot: The robot named in it.
        obstacles: What the robot's body must not touch.
        plan: How the path was found, and where the robot's centre may be.
        path: The smooth path; for minimum time, as it was moved. Its headings are those of the
            motion, unless the timing chose others.
        fastest: The fastest motion along it within the limits; None for uniform timing.
        note: What there is to say of how the timing went.
    """

    scenario: Scenario
    robot: Robot
    obstacles: OccupancyGrid
    plan: Plan
    path: SplinePath
    fastest: TimedReference | None
    note: str = ""

    @property
    def clearance_bounds(self) -> tuple[float, float]:
        """Proved bounds on the distance in m between the robot's body and an obstacle."""
        least, most = self.path.clearance(self.obstacles)
        return least - self.robot.body_radius, most - self.robot.body_radius

    def clearance(self, points: Float[Array, "points 2"]) -> float:
        """Least distance in m between the robot's body and an obstacle, centred on ``points``."""
        return float(self.obstacles.clearance(points).min()) - self.robot.body_radius

    @property
    def start(self) -> Pose:
        """Where the motion begins: with the timing ``limits`` not always the path's heading."""
        if self.fastest is not None:
            return self.fastest.at(0.0).pose
        return Pose(*self.path.poses(0.0).tolist())

    @property
    def shortest(self) -> float:
        """The shortest duration in s that the limits allow, to 0.1 s if the timing is uniform."""
        if self.fastest is not None:
            return self.fastest.duration
        return shortest_duration(self.path, self.robot.chassis)

    def reference(self, duration: float) -> Reference:
        """The path in ``duration`` seconds.

        Raises:
            InvalidReference: The robot cannot follow it that fast.
        """
        if self.fastest is not None:
            return self.fastest.with_duration(duration)
        return time_uniformly(self.path, duration, self.robot.chassis)


def plan_scenario(scenario: Scenario) -> PlannedScenario:
    """Read the map, plan the path and find the fastest motion along it.

    Raises:
        InvalidMap: The map cannot be read.
        InvalidWaypoint: The robot cannot stand at start or goal.
        NoPathFound: There is no way between them.
        InvalidInput: There is no such robot, or it cannot stand or move as it is changed.
        InvalidReference: The timing is for other paths.
        MissingExtra: The timing needs an extra that is not installed.
    """
    robot = robot_of(scenario.robot)
    source, inflation_note = scenario.map, ""
    if source.source == "paper":
        obstacles, grid, inflation = paper_wall(), paper_map(), source.margin
    else:
        obstacles = grid = load_map(
            FilePath(source.source), resolution=source.resolution, unknown=source.unknown
        )
        # centres of cells keep this; the path, which is anywhere in them, half a diagonal less
        half = grid.resolution * 0.5**0.5
        inflation = robot.body_radius + max(source.margin, half)
        if half > source.margin:
            inflation_note = (
                f"the body's radius of {robot.body_radius:g} m and half a cell's diagonal, "
                f"{half:.3g} m, which is more than the margin of {source.margin:g} m"
            )
    found = plan(
        grid,
        scenario.start,
        scenario.goal,
        inflation=inflation,
        options=scenario.path,
        inflation_note=inflation_note,
    )
    path, fastest, note = _timed(scenario, robot, found)
    return PlannedScenario(scenario, robot, obstacles, found, path, fastest, note)


def _timed(
    scenario: Scenario, robot: Robot, found: Plan
) -> tuple[SplinePath, TimedReference | None, str]:
    """The path, the fastest motion along it, and what to say of it."""
    timing, chassis = scenario.timing, robot.chassis
    if timing.law == "uniform":
        return found.spline, None, ""
    most = timing.wheel_acceleration
    limits = MotionLimits.of_robot(robot, share=timing.traction)
    if most is not None:
        limits = replace(limits, wheel_acceleration=most)
    if timing.law == "minimum-time":
        best = minimum_time(
            found.spline,
            chassis,
            limits,
            found.free_space,
            start_yaw=scenario.start.yaw,
            goal_yaw=scenario.goal.yaw,
        )
        return best.path, best.reference, f"{best.status}: {best.message}"
    reference = time_within_limits(
        found.spline,
        chassis,
        limits,
        heading=timing.heading,
        start_yaw=scenario.start.yaw,
        goal_yaw=scenario.goal.yaw,
    )
    return found.spline, reference, ""


def plan_and_check(scenario: Scenario) -> PlannedScenario:
    """As :func:`plan_scenario`, and check that the robot can follow the path in every duration.

    Raises:
        InvalidReference: A duration is too short for the wheels; the message says which is not.
        InvalidInput: A fault is of a wheel that the robot does not have.
    """
    planned = plan_scenario(scenario)
    task = scenario.tasks.faults
    Schedule((*scenario.faults, *(task.faults if task else ())), planned.robot)
    for duration in scenario.tasks.path_durations:
        planned.reference(duration)
    return planned
