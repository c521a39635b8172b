"""Compilation of every kernel before it is needed."""

from __future__ import annotations

import logging
from collections.abc import Generator, Sequence
from contextlib import closing
from functools import partial
from typing import get_args

import numpy as np

from omnidrive.choices import MethodName, PresetName
from omnidrive.compiled.cache_folder import failures, usable_folder
from omnidrive.compiled.compilation import announce_compiling
from omnidrive.control.nmpc.holonomic import HolonomicSolver, speed_limits, stack_keep_outs
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.errors import CannotWrite, RunFailed
from omnidrive.estimation import PoseEstimator, PoseFix, SensorReadings, State
from omnidrive.execution.worker_pool import Call, Lost, WorkerPool
from omnidrive.geometry import Pose
from omnidrive.maps import maze_map
from omnidrive.planning import PathOptions, Waypoint, plan, search
from omnidrive.reference import Corridor, MotionLimits, time_within_limits
from omnidrive.robot import named_robot
from omnidrive.scenario.planned_scenario import plan_scenario
from omnidrive.scenario.run_parts import make_controller
from omnidrive.scenario.scenario import paper_scenario
from omnidrive.scenario.tasks import DurationsTask, Tasks
from omnidrive.simulation.identification.response import response
from omnidrive.study.computation.block_runner import run_block
from omnidrive.study.design.definition import StudyDefinition
from omnidrive.study.design.run_plan import RunPlan
from omnidrive.study.progress import NullProgress, ProgressListener


def warm_up(progress: ProgressListener | None = None, *, processes: int = 1) -> None:
    """Compile all kernels that planning, every controller of every preset and batches need.

    The compiled kernels are cached on disk, for their present code and this processor.

    Args:
        progress: Notified when a part is compiled.
        processes: Number of processes that compile at the same time.

    Raises:
        CannotWrite: The compiled kernels cannot be kept on disk.
        RunFailed: The process that compiles a part was killed three times.
        WorkerLost: No process could be started.
    """
    if usable_folder() is None:
        raise CannotWrite(failures[-1])
    progress = progress or NullProgress()
    parts = _parts()
    progress.part("warm up", len(parts))
    with announce_compiling(note=""), closing(_compile(parts, processes)) as finished:
        for name, lost in finished:
            progress.done(name)
            if lost:
                raise CannotWrite(lost[0])


def _parts() -> list[Call]:
    """Return functions whose calls compile all kernels, the costliest first."""
    controllers = [
        (preset, name)
        for preset in get_args(PresetName)
        for name in paper_scenario(preset).controllers
    ]
    controllers.sort(key=lambda each: not each[1].endswith("nmpc"))
    return [
        Call("batches", _batch),
        *(
            Call(f"{name} ({preset})", partial(_control, preset, name))
            for preset, name in controllers
        ),
        *(Call(f"studies ({plant})", partial(_study, plant)) for plant in ("planar", "kinematic")),
        Call("planning", _plans),
        Call("estimator", _estimate),
        Call("identification", _identify),
    ]


def _compile(parts: Sequence[Call], processes: int) -> Generator[tuple[str, list[str]], None, None]:
    """Compile each part, and yield its name and why its kernels were not kept."""
    if processes <= 1:
        for part in parts:
            yield part.name, _compile_part(part)
        return
    calls = [Call(part.name, partial(_compile_part, part)) for part in parts]
    with WorkerPool(processes, _be_silent) as pool:
        for index, outcome in pool.outcomes(calls):
            name = parts[index].name
            if isinstance(outcome, Lost):
                raise RunFailed(f"compilation of {name}: {outcome.value}; run the command again")
            yield name, outcome


def _be_silent() -> None:
    """Leave messages to the parent process."""
    logging.getLogger("omnidrive").setLevel(logging.ERROR)


def _compile_part(part: Call) -> list[str]:
    """Compile what one part needs; return why kernels were not kept."""
    part.function()
    return failures


def _control(preset: PresetName, name: str) -> None:
    """Plan the scenario of a preset and compute one command of a controller."""
    scenario = paper_scenario(preset)
    planned = plan_scenario(scenario)
    reference = planned.reference(20.0)
    controller = make_controller(scenario, planned.robot, name)
    start = State(0.0, reference.at(0.0).pose)
    controller.reset(start)
    controller.step(0.0, start._replace(pose=reference.at(0.1).pose), reference)


def _plans() -> None:
    """Query a map, search it by every method, smooth and time the path."""
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
    """Update an estimator with two readings and a pose fix each."""
    estimator = PoseEstimator(named_robot("paper"))
    for k in range(2):
        fix = PoseFix(0.1 * k, Pose(0.0, 0.0, 0.0), 0.01, 0.01)
        estimator.update(SensorReadings(0.1 * k, (0.0,) * 4, yaw_rate=0.0, fixes=(fix,)))


def _identify() -> None:
    """Predict the response to a command, as the identification of a robot does."""
    response(
        named_robot("paper"), np.arange(3.0), np.zeros((3, 3)), (0.01, 0.01), 0.0, friction=0.5
    )


def _study(plant: str) -> None:
    """Simulate a block of runs of every controller with a compiled loop."""
    scenario = paper_scenario("recommended").with_values(
        plant=plant,
        controllers=("pid", "feedforward", "holonomic-nmpc"),
        tasks=Tasks(track=DurationsTask(durations=(20.0,))),
    )
    run_block(RunPlan(StudyDefinition.from_scenario(scenario))[:])


def _batch() -> None:
    """Solve a problem with and without a deadline, and as a batch of one."""
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
