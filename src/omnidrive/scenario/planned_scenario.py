"""Planned scenarios: map, motion and its path."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from math import ceil, inf

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Plan, SplinePath, plan
from omnidrive.reference import (
    LimitRows,
    MotionLimits,
    Reference,
    ReferenceContext,
    ReferencePath,
    RetimedReference,
    ShapeReference,
    TimedReference,
    limit_rows,
    limit_usage,
    minimum_time,
    shortest_duration,
    shortest_duration_within,
    slowed_to,
    time_uniformly,
    time_within_limits,
)
from omnidrive.robot import Robot
from omnidrive.scenario.grids import costs_of, grids_of, inflation_of, open_floor
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.sections import robot_of
from omnidrive.simulation.disturbances import Schedule

_EXCESS = 0.011
"""Tolerated relative excess of a limit: written motions keep their limits within 1 %."""

_log = logging.getLogger("omnidrive")


@dataclass(frozen=True, eq=False, slots=True)
class PlannedScenario:
    """Scenario with robot, map and motion, shared by all runs of a study.

    Attributes:
        scenario: The scenario.
        robot: Model of the robot in controllers.
        plant_robot: The simulated robot.
        obstacles: Map without inflation.
        free_space: The inflated map, whose free cells the robot's centre may enter.
        plan: Results of search and smoothing; None unless the reference is a planned path.
        path: Path of the motion: the smooth path or, with the timing `minimum-time`, the optimised
            one. Its headings are those of the motion unless the timing determines the heading.
        motion: Motion that is slowed down or sped up to the durations of the tasks: the fastest one
            along the planned path within the limits, or that of the scenario's reference. None for
            a planned path with the timing `uniform`.
        note: Status and message of the minimum-time optimisation; otherwise empty.
    """

    scenario: Scenario
    robot: Robot
    plant_robot: Robot
    obstacles: OccupancyGrid
    free_space: OccupancyGrid
    plan: Plan | None
    path: SplinePath | ReferencePath
    motion: Reference | None
    note: str = ""

    @property
    def clearance_bounds(self) -> tuple[float, float]:
        """Lower and upper bound on the least distance of the body to an obstacle, m.

        Those of a planned path are proved.
        """
        minimum, maximum = self.path.clearance(self.obstacles)
        return minimum - self.robot.body_radius, maximum - self.robot.body_radius

    def clearance(self, points: Float[Array, "points 2"]) -> float:
        """Return the least distance, m, from body to obstacles over centres ``points`` (W, m)."""
        return float(self.clearances(points[None])[0])

    def clearances(self, points: Float[Array, "runs points 2"]) -> Float[Array, " runs"]:
        """Return the value of :meth:`clearance` for each of several runs."""
        distances = self.obstacles.clearance(points.reshape(-1, 2)).reshape(len(points), -1)
        minimum: Float[Array, " runs"] = distances.min(axis=1) - self.robot.body_radius
        return minimum

    @property
    def start(self) -> Pose:
        """Start pose of the motion in W; m, m, rad. The timing may determine its heading."""
        if self.motion is not None:
            return self.motion.at(0.0).pose
        return Pose(*self.path.poses(0.0).tolist())

    @property
    def limits(self) -> tuple[LimitRows, ...]:
        """Limits of the motion: speeds and, unless the timing is `uniform`, accelerations."""
        if self.motion is None:
            return self._speed_limits
        return limit_rows(self.robot.chassis, _motion_limits(self.scenario, self.robot))

    @property
    def _speed_limits(self) -> tuple[LimitRows, ...]:
        """Limits of the speeds, that of the wheels without a reserve."""
        return tuple(each for each in self._whole_limits if each.kind == "speed")

    @property
    def _whole_limits(self) -> tuple[LimitRows, ...]:
        """Limits of the motion without a reserve for feedback."""
        whole = replace(
            _motion_limits(self.scenario, self.robot),
            wheel_speed=self.robot.max_wheel_speed,
            acceleration_faces=self.robot.acceleration_faces
            / max(self.scenario.timing.traction, 1.0),
        )
        return limit_rows(self.robot.chassis, whole)

    @property
    def shortest(self) -> float:
        """Shortest duration within the limits, s; rounded to 0.1 s with the timing `uniform`."""
        if isinstance(self.motion, TimedReference):
            return self.motion.duration
        if self.motion is not None:
            return shortest_duration_within(self.motion, self.limits)
        assert isinstance(self.path, SplinePath)
        return shortest_duration(self.path, self.robot.chassis, self._max_speed)

    @property
    def minimum(self) -> float:
        """Shortest duration that :meth:`reference` accepts, s.

        It differs from :attr:`shortest` for a motion that is not along a planned path: only its
        speeds are limited.
        """
        if self.motion is None or isinstance(self.motion, TimedReference):
            return self.shortest
        return shortest_duration_within(self.motion, self._speed_limits)

    @property
    def _max_speed(self) -> float:
        return self.scenario.timing.max_speed or inf

    @property
    def natural(self) -> float | None:
        """Duration of a motion with times of its own, s; None: only limits determine it."""
        by_limits = self.motion is None or isinstance(self.motion, TimedReference | ShapeReference)
        return None if by_limits or self.motion is None else self.motion.duration

    def reference(self, duration: float) -> Reference:
        """Return the motion in ``duration`` seconds.

        Raises:
            InvalidReference: The duration is too short for the limits. Only speeds limit a motion
                that is not along a planned path.
        """
        if isinstance(self.motion, TimedReference):
            return self.motion.with_duration(duration)
        if self.motion is None:
            assert isinstance(self.path, SplinePath)
            return time_uniformly(self.path, duration, self.robot.chassis, self._max_speed)
        self._check_speeds(self.motion, duration)
        if duration == self.motion.duration:
            return self.motion
        return RetimedReference(self.motion, duration)

    def _check_speeds(self, motion: Reference, duration: float) -> None:
        usage = limit_usage(motion, self._speed_limits)
        name, share = max(usage.items(), key=lambda item: item[1])
        share *= motion.duration / duration
        if share > 1.0 + _EXCESS:
            top = self._max_speed if name == "speed" else self.robot.max_wheel_speed
            need = _above(share * top, top)
            excess = (
                f"the speed would reach {need} m/s, and the largest is {top:g} m/s"
                if name == "speed"
                else f"a wheel would need {need} rad/s and reaches {top:g} rad/s"
            )
            raise InvalidReference(
                f"{duration:g} s is too short for this reference: {excess}. The shortest duration "
                f"is {ceil(10.0 * share * duration) / 10.0:g} s"
            )


def _above(value: float, limit: float) -> str:
    """Return a value above a limit with as many decimals as it needs to be read as above it."""
    texts = (f"{value:.{decimals}f}" for decimals in range(17))
    return next((text for text in texts if float(text) > float(f"{limit:g}")), repr(value))


def plan_scenario(scenario: Scenario) -> PlannedScenario:
    """Read the map, plan the path and find the fastest motion along it, or make the reference.

    Raises:
        InvalidMap: The map cannot be read.
        InvalidWaypoint: The robot would touch an obstacle at start or goal.
        NoPathFound: There is no path between them.
        InvalidInput: The name of the robot is unknown, or its parameters are not possible.
        InvalidReference: The timing is not applicable to the path, or the reference is not
            possible.
        MissingExtra: The timing needs an extra that is not installed.
    """
    robot, true_robot = robot_of(scenario.robot), robot_of(scenario.true_robot)
    if scenario.reference != "path":
        return _with_reference(scenario, robot, true_robot)
    assert scenario.start is not None
    assert scenario.goal is not None
    obstacles, grid = grids_of(scenario.map)
    inflation, inflation_note = inflation_of(scenario.map, grid, robot)
    plan_ = plan(
        grid,
        scenario.start,
        scenario.goal,
        inflation=inflation,
        options=scenario.path,
        inflation_note=inflation_note,
        min_inflation=inflation_of(scenario.map.model_copy(update={"margin": 0.0}), grid, robot)[0],
        costs=costs_of(scenario.costs, grid, robot, scenario.timing.max_speed),
        around_obstacles=None if scenario.costs is None else scenario.costs.around_obstacles,
    )
    path, fastest, note = _timed(scenario, robot, plan_)
    return PlannedScenario(
        scenario, robot, true_robot, obstacles, plan_.free_space, plan_, path, fastest, note
    )


def _with_reference(scenario: Scenario, robot: Robot, true_robot: Robot) -> PlannedScenario:
    """Return the planned scenario of a reference that is not a planned path."""
    assert scenario.reference != "path"
    x, y, yaw = scenario.start or (0.0, 0.0, None)
    top = scenario.timing.max_speed
    made = scenario.reference.make(ReferenceContext(robot, Pose(x, y, yaw or 0.0), top))
    motion = slowed_to(_checked_motion(scenario.reference.type, made), top)
    path = ReferencePath.of(motion)
    if scenario.map.source == "none":
        obstacles = grid = open_floor(path, robot)
        free_space = grid
    else:
        obstacles, grid = grids_of(scenario.map)
        free_space = grid.inflated(inflation_of(scenario.map, grid, robot)[0])
    return PlannedScenario(scenario, robot, true_robot, obstacles, free_space, None, path, motion)


def _checked_motion(name: str, motion: object) -> Reference:
    """Return what a component made, if it is a reference with a finite motion."""
    if not isinstance(motion, Reference):
        raise InvalidReference(
            f"the reference '{name}' returned a {type(motion).__name__}, need an object with "
            "duration, at(t) and window(t, n, dt)"
        )
    duration = motion.duration
    if not (np.isfinite(duration) and duration > 0.0):
        raise InvalidReference(f"the reference '{name}' has a duration of {duration:g} s")
    rows = motion.window(0.0, 11, 0.1 * duration)
    if np.shape(rows) != (11, 6) or not np.isfinite(rows).all():
        raise InvalidReference(
            f"the reference '{name}' must return finite rows (x, y, yaw, vx, vy, yaw rate) from "
            f"window(t, n, dt), got an array of shape {np.shape(rows)}"
        )
    return motion


def _motion_limits(scenario: Scenario, robot: Robot) -> MotionLimits:
    """Return the limits of the section `timing`."""
    timing = scenario.timing
    limits = MotionLimits.of_robot(robot, share=timing.traction, max_speed=timing.max_speed)
    if timing.wheel_acceleration is None:
        return limits
    return replace(limits, wheel_acceleration=timing.wheel_acceleration)


def _timed(
    scenario: Scenario, robot: Robot, plan_: Plan
) -> tuple[SplinePath, TimedReference | None, str]:
    """Return the path, the fastest motion along it, and the note on the timing."""
    timing, chassis = scenario.timing, robot.chassis
    if timing.law == "uniform":
        return plan_.spline, None, ""
    limits = _motion_limits(scenario, robot)
    assert scenario.start is not None
    assert scenario.goal is not None
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
        zones=plan_.costs,
        target=timing.target,
    )
    return plan_.spline, reference, ""


def plan_and_check(scenario: Scenario) -> PlannedScenario:
    """Plan a scenario and check all its durations and faults before any run.

    A warning is logged if a reference that is not a planned path overlaps an obstacle, or exceeds
    the acceleration limits in its shortest task.

    Raises:
        InvalidReference: A duration is too short for the limits of the robot; the message states
            the shortest feasible one.
        InvalidInput: A fault affects a wheel that the robot does not have.
        OmnidriveError: As :func:`plan_scenario`.
    """
    planned = plan_scenario(scenario)
    if planned.plan is None:
        _note_excess(planned)
    task = scenario.tasks.faults
    Schedule((*scenario.faults, *(task.faults if task else ())), planned.robot)
    for duration in scenario.tasks.path_durations:
        planned.reference(duration)
    return planned


def _note_excess(planned: PlannedScenario) -> None:
    """Log warnings: the limit that the reference exceeds most, and obstacles on its path."""
    durations = planned.scenario.tasks.path_durations
    if durations:
        reference = planned.reference(durations[0])
        if max(limit_usage(reference, planned.limits).values()) > 1.0 + _EXCESS:
            usage = limit_usage(reference, planned._whole_limits)
            name, share = max(usage.items(), key=lambda item: item[1])
            _log.warning(
                "the reference in %g s %s is %.1f s",
                durations[0], _excess(name, share), ceil(10.0 * planned.shortest) / 10.0,
            )  # fmt: skip
    depth = -planned.clearance_bounds[1]
    if depth > 0.0:
        _log.warning(
            "the robot overlaps an obstacle of the map on the reference, by up to %.2g m; move "
            "the start, or choose another map, such as none",
            depth,
        )


def _excess(name: str, share: float) -> str:
    """Return what a share of a limit means for the robot, up to "is" the shortest duration."""
    if share > 1.0 + _EXCESS:
        return (
            f"exceeds the limit of the {name} by a factor of {share:.2f}, so that the robot cannot "
            "follow it exactly; the shortest duration within the limits"
        )
    return (
        f"uses {share:.2f} of the limit of the {name}, which leaves too little for feedback: the "
        "robot may follow it late; the shortest duration with a reserve"
    )
