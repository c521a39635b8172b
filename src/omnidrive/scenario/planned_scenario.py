"""Planned scenarios: map, motion and its path."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from math import ceil, inf

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import Pose
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import FootprintPlan, SplinePath, footprint_clearance
from omnidrive.planning.footprint import pose_distance
from omnidrive.reference import (
    LimitedReference,
    LimitRows,
    Reference,
    ReferenceContext,
    ReferencePath,
    RetimedReference,
    ShapeReference,
    limit_rows,
    limit_usage,
    shortest_duration,
    shortest_duration_within,
    slowed_to,
    time_uniformly,
)
from omnidrive.robot import Robot
from omnidrive.scenario.fastest_motion import fastest_motion, motion_limits
from omnidrive.scenario.grids import grids_of, inflation_of, open_floor
from omnidrive.scenario.path_planning import ScenarioPlan, planned_path
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.sections import robot_of
from omnidrive.simulation.disturbances import Schedule

_EXCESS = 0.011
"""Tolerated relative excess of a limit: written motions keep their limits within 1 %."""

_SAMPLES = 2001  # poses along a motion

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
        plan: Results of search and smoothing; None unless the reference is a planned path. With the
            shape that was needed if the robot has an outline.
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
    plan: ScenarioPlan | None
    path: SplinePath | ReferencePath
    motion: Reference | None
    note: str = ""

    @property
    def keeps_headings(self) -> bool:
        """Whether the robot fits between the obstacles only at the headings of its path."""
        return isinstance(self.plan, FootprintPlan) and self.plan.shape == "polygon"

    @property
    def clearance_bounds(self) -> tuple[float, float]:
        """Lower and upper bound on the least distance of the body to an obstacle, m.

        Those of a planned path are proved. The body is the disc, except that the upper bound is
        that of the outline, if the robot has one, and that the polygon has a proof of its own where
        the path is planned for it.
        """
        minimum, maximum = (
            each - self.robot.body_radius for each in self.path.clearance(self.obstacles)
        )
        if self.robot.outline is None:
            return minimum, maximum
        if self.keeps_headings and isinstance(self.path, SplinePath):
            outline = np.array(self.robot.outline)
            # as for the plan: the search has proved the parts that follow its polyline
            minimum = max(footprint_clearance(self.obstacles, outline, self.path), 0.0)
        return minimum, self.clearance(self._sampled_poses)

    @property
    def _sampled_poses(self) -> Float[Array, "poses 3"]:
        """Poses along the motion."""
        if self.motion is None:
            return self.path.poses(np.linspace(0.0, 1.0, _SAMPLES))
        step = self.motion.duration / (_SAMPLES - 1)
        return self.motion.window(0.0, _SAMPLES, step)[:, :3]

    def clearance(self, poses: Float[Array, "poses 3"]) -> float:
        """Return the least distance, m, from the body at ``poses`` (W; m, m, rad) to obstacles.

        The body is the outline of the robot or, without one, its disc.
        """
        return float(self.clearances(poses[None])[0])

    def clearances(self, poses: Float[Array, "runs poses 3"]) -> Float[Array, " runs"]:
        """Return the value of :meth:`clearance` for each of several runs."""
        if self.robot.outline is not None:
            polygon = Polygon.of(np.array(self.robot.outline))
            return np.array([pose_distance(self.obstacles, polygon, each) for each in poses])
        points = poses[:, :, :2].reshape(-1, 2)
        distances = self.obstacles.clearance(points).reshape(len(poses), -1)
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
        return limit_rows(self.robot.chassis, motion_limits(self.scenario, self.robot))

    @property
    def _speed_limits(self) -> tuple[LimitRows, ...]:
        """Limits of the speeds, that of the wheels without a reserve."""
        return tuple(each for each in self._whole_limits if each.kind == "speed")

    @property
    def _whole_limits(self) -> tuple[LimitRows, ...]:
        """Limits of the motion without a reserve for feedback."""
        whole = replace(
            motion_limits(self.scenario, self.robot),
            wheel_speed=self.robot.max_wheel_speed,
            acceleration_faces=self.robot.acceleration_faces
            / max(self.scenario.timing.traction, 1.0),
        )
        return limit_rows(self.robot.chassis, whole)

    @property
    def shortest(self) -> float:
        """Shortest duration within the limits, s; rounded to 0.1 s with the timing `uniform`."""
        if isinstance(self.motion, LimitedReference):
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
        if self.motion is None or isinstance(self.motion, LimitedReference):
            return self.shortest
        return shortest_duration_within(self.motion, self._speed_limits)

    @property
    def _max_speed(self) -> float:
        return self.scenario.timing.max_speed or inf

    @property
    def natural(self) -> float | None:
        """Duration of a motion with times of its own, s; None: only limits determine it."""
        if self.motion is None or isinstance(self.motion, LimitedReference | ShapeReference):
            return None
        return self.motion.duration

    def reference(self, duration: float) -> Reference:
        """Return the motion in ``duration`` seconds.

        Raises:
            InvalidReference: The duration is too short for the limits. Only speeds limit a motion
                that is not along a planned path.
        """
        if isinstance(self.motion, LimitedReference):
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


def plan_scenario(scenario: Scenario, time_limit: float | None = None) -> PlannedScenario:
    """Read the map, plan the path and find the fastest motion along it, or make the reference.

    Args:
        scenario: The scenario.
        time_limit: Time for search and smoothing of the path, and again for the optimisation with
            the timing `minimum-time`, in s, positive; None: no limit.

    Raises:
        InvalidMap: The map cannot be read.
        InvalidWaypoint: The robot would touch an obstacle at start or goal.
        NoPathFound: There is no path between them.
        NoPathYet: There is none within the time limit.
        InvalidInput: The name of the robot is unknown, its parameters are not possible, or the time
            limit is not positive or not applicable.
        InvalidReference: The timing is not applicable to the path, or the reference is not
            possible.
        MissingExtra: The timing needs an extra that is not installed.
    """
    robot, true_robot = robot_of(scenario.robot), robot_of(scenario.true_robot)
    if scenario.reference != "path":
        if time_limit is not None:
            raise InvalidInput("a time limit applies to planned paths only: omit it")
        return _with_reference(scenario, robot, true_robot)
    obstacles, plan_ = planned_path(scenario, robot, time_limit)
    path, fastest, note = fastest_motion(scenario, robot, plan_, time_limit)
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


def plan_and_check(scenario: Scenario, time_limit: float | None = None) -> PlannedScenario:
    """Plan a scenario and check all its durations and faults before any run.

    A warning is logged if a reference that is not a planned path overlaps an obstacle, or exceeds
    the acceleration limits in its shortest task.

    Args:
        scenario: The scenario.
        time_limit: As for :func:`plan_scenario`.

    Raises:
        InvalidReference: A duration is too short for the limits of the robot; the message states
            the shortest feasible one.
        InvalidInput: A fault affects a wheel that the robot does not have.
        OmnidriveError: As :func:`plan_scenario`.
    """
    planned = plan_scenario(scenario, time_limit)
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
