"""Compilation of every kernel before it is needed."""

from __future__ import annotations

from typing import get_args

import numpy as np

from omnidrive.control.nmpc.holonomic import HolonomicSolver, speed_limits, stack_keep_outs
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.estimation import PoseEstimator, PoseFix, SensorReadings, State
from omnidrive.geometry import Pose
from omnidrive.maps import maze_map
from omnidrive.planning import MethodName, PathOptions, Waypoint, plan, search
from omnidrive.reference import Corridor, MotionLimits, time_within_limits
from omnidrive.robot import named_robot
from omnidrive.study.jobs import make_controller
from omnidrive.study.planned_scenario import plan_scenario
from omnidrive.study.scenario import PresetName, paper_scenario
from omnidrive.study.study import NullProgress, ProgressListener


def warm_up(watcher: ProgressListener | None = None) -> None:
    """Plan in every way, let every controller of every preset command once, and solve in a batch.

    What is compiled is kept on disk: for this version of the package, and this processor.
    """
    watch = watcher or NullProgress()
    scenarios = [paper_scenario(preset) for preset in get_args(PresetName)]
    watch.part("warm up", 3 + sum(len(scenario.controllers) for scenario in scenarios))
    _plans()
    watch.done("planning")
    for scenario in scenarios:
        prepared = plan_scenario(scenario)
        reference = prepared.reference(20.0)
        for name in scenario.controllers:
            controller = make_controller(scenario, prepared.robot, name)
            start = State(0.0, reference.at(0.0).pose)
            controller.reset(start)
            controller.step(0.0, start._replace(pose=reference.at(0.1).pose), reference)
            watch.done(name)
    _batch()
    watch.done("batches")
    _estimate()
    watch.done("estimator")


def _plans() -> None:
    """Look at a map in every way, search it by every method, smooth and time the way."""
    robot = named_robot("small")
    grid = maze_map(20, 20, 8, np.random.default_rng(0), resolution=0.1)
    grid.inflated_by(0.1 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0]]), 0.1)
    grid.nearest_free(0.0, 0.0)
    grid.region_size(8, 8)
    grid.clearance(np.array([[0.0, 0.0], [0.4, 0.4]]))
    free = np.argwhere(~grid.occupied)
    for method in get_args(MethodName):
        search(grid, tuple(free[0].tolist()), tuple(free[-1].tolist()), method=method)
    start, goal = (Waypoint(*grid.centre(*free[i].tolist())) for i in (0, -1))
    found = plan(grid, start, goal, inflation=0.05, options=PathOptions())
    time_within_limits(found.spline, robot.chassis, MotionLimits.of_robot(robot))
    Corridor.along(found.grid_path.poses[:, :2], found.free_space)


def _estimate() -> None:
    """Two readings and a fix."""
    estimator = PoseEstimator(named_robot("paper"))
    for k in range(2):
        fix = PoseFix(0.1 * k, Pose(0.0, 0.0, 0.0), 0.01, 0.01)
        estimator.update(SensorReadings(0.1 * k, (0.0,) * 4, yaw_rate=0.0, fixes=(fix,)))


def _batch() -> None:
    """A problem alone, with and without a deadline, and as a batch of one."""
    points, chassis = 3, named_robot("paper").chassis
    problem = HolonomicProblem(
        dt=0.1,
        start=np.zeros(3),
        previous=np.zeros(3),
        targets=np.ones((points, 3)),
        feedforward=np.zeros((points - 1, 3)),
        state_weights=np.ones((points, 3)),
        control_weights=np.ones(3),
        limits=speed_limits(chassis.jacobian, 1.0, 0.1),
        keep_outs=stack_keep_outs((), points),
    )
    HolonomicSolver().precompile(problem)
    HolonomicSolver(deadline=10.0).solve(problem)
    one = {
        name: getattr(problem, name)[None]
        for name in ("start", "previous", "targets", "feedforward")
    }
    HolonomicSolver().solve_many(problem._replace(**one))
