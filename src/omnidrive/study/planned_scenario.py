"""Planned scenarios: map, path and timing."""

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
    """Scenario with robot, map, path and timing, shared by all runs of a study.

    Attributes:
        scenario: The scenario.
        robot: The robot, as far as controllers know it.
        plant_robot: The simulated robot.
        obstacles: Map without inflation.
        plan: Results of search and smoothing, and the free space of the robot's centre.
        path: Smooth path; with the timing `minimum-time`, the optimised one. Its headings are those
            of the motion unless the timing determines the heading.
        fastest: Fastest motion along the path within the limits; None with the timing `uniform`.
        note: Status and message of the minimum-time optimisation; otherwise empty.
    """

    scenario: Scenario
    robot: Robot
    plant_robot: Robot
    obstacles: OccupancyGrid
    plan: Plan
    path: SplinePath
    fastest: TimedReference | None
    note: str = ""

    @property
    def clearance_bounds(self) -> tuple[float, float]:
        """Proved lower and upper bound on the least distance of the body to an obstacle, m."""
        least, most = self.path.clearance(self.obstacles)
        return least - self.robot.body_radius, most - self.robot.body_radius

    def clearance(self, points: Float[Array, "points 2"]) -> float:
        """Return the least distance, m, from body to obstacles over centres ``points`` (W, m)."""
        return float(self.obstacles.clearance(points).min()) - self.robot.body_radius

    @property
    def start(self) -> Pose:
        """Start pose of the motion in W; m, m, rad. The timing may determine its heading."""
        if self.fastest is not None:
            return self.fastest.at(0.0).pose
        return Pose(*self.path.poses(0.0).tolist())

    @property
    def shortest(self) -> float:
        """Shortest feasible duration, s; rounded to 0.1 s with the timing `uniform`."""
        if self.fastest is not None:
            return self.fastest.duration
        return shortest_duration(self.path, self.robot.chassis)

    def reference(self, duration: float) -> Reference:
        """Return the motion along the path in ``duration`` seconds.

        Raises:
            InvalidReference: The duration is too short for the limits of the robot.
        """
        if self.fastest is not None:
            return self.fastest.with_duration(duration)
        return time_uniformly(self.path, duration, self.robot.chassis)


def plan_scenario(scenario: Scenario) -> PlannedScenario:
    """Read the map, plan the path and find the fastest motion along it.

    Raises:
        InvalidMap: The map cannot be read.
        InvalidWaypoint: The robot would touch an obstacle at start or goal.
        NoPathFound: There is no path between them.
        InvalidInput: The name of the robot is unknown, or its parameters are not possible.
        InvalidReference: The timing is not applicable to the path.
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
        # this distance holds for cell centres; a point of a cell is half a diagonal from its centre
        half_diagonal = grid.resolution * 0.5**0.5
        inflation = robot.body_radius + max(source.margin, half_diagonal)
        if half_diagonal > source.margin:
            inflation_note = (
                f"the body radius of {robot.body_radius:g} m and half a cell diagonal, "
                f"{half_diagonal:.3g} m, which is larger than the margin of {source.margin:g} m"
            )
    plan_ = plan(
        grid,
        scenario.start,
        scenario.goal,
        inflation=inflation,
        options=scenario.path,
        inflation_note=inflation_note,
    )
    path, fastest, note = _timed(scenario, robot, plan_)
    true_robot = robot_of(scenario.true_robot)
    return PlannedScenario(scenario, robot, true_robot, obstacles, plan_, path, fastest, note)


def _timed(
    scenario: Scenario, robot: Robot, plan_: Plan
) -> tuple[SplinePath, TimedReference | None, str]:
    """Return the path, the fastest motion along it, and the note on the timing."""
    timing, chassis = scenario.timing, robot.chassis
    if timing.law == "uniform":
        return plan_.spline, None, ""
    limits = MotionLimits.of_robot(robot, share=timing.traction)
    if timing.wheel_acceleration is not None:
        limits = replace(limits, wheel_acceleration=timing.wheel_acceleration)
    if timing.law == "minimum-time":
        result = minimum_time(
            plan_.spline,
            chassis,
            limits,
            plan_.free_space,
            start_yaw=scenario.start.yaw,
            goal_yaw=scenario.goal.yaw,
        )
        return result.path, result.reference, f"{result.status}: {result.message}"
    reference = time_within_limits(
        plan_.spline,
        chassis,
        limits,
        heading=timing.heading,
        start_yaw=scenario.start.yaw,
        goal_yaw=scenario.goal.yaw,
    )
    return plan_.spline, reference, ""


def plan_and_check(scenario: Scenario) -> PlannedScenario:
    """Plan a scenario and check all its durations and faults before any run.

    Raises:
        InvalidReference: A duration is too short for the limits of the robot; the message states
            the shortest feasible one.
        InvalidInput: A fault affects a wheel that the robot does not have.
        OmnidriveError: As :func:`plan_scenario`.
    """
    planned = plan_scenario(scenario)
    task = scenario.tasks.faults
    Schedule((*scenario.faults, *(task.faults if task else ())), planned.robot)
    for duration in scenario.tasks.path_durations:
        planned.reference(duration)
    return planned
