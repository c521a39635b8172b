"""Streams of NMPC problems: a robot on a curved path, with noise and displacements."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from omnidrive.control.nmpc import PRESETS, UnicycleController, UnicycleProblem, UnicycleSolver
from omnidrive.control.nmpc.common.cost import tracking_cost
from omnidrive.control.nmpc.holonomic import (
    HolonomicController,
    HolonomicOptimizer,
    HolonomicProblem,
    HolonomicSolver,
    KeepOutZone,
    Limits,
    holonomic_nmpc,
    rate_limits,
    speed_limits,
    stack_limits,
)
from omnidrive.control.nmpc.holonomic.keep_out_zone import KeepOutForecast
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, move
from omnidrive.reference import Setpoint
from omnidrive.robot import named_robot

DT, STEPS = 0.1, 300
SPEED, YAW_RATE, ARC = 0.7, 0.5, 6.0  # m/s, rad/s, seconds from one bend to the next
ADVANCE, WAVE, WAVE_RATE = 0.5, 0.6, 0.8  # m/s, m, rad/s
POSITION_NOISE, HEADING_NOISE, SEED = 0.01, 0.02, 1  # m, rad
DISPLACEMENTS = {60: (0.3, 0.27, 0.5), 150: (-0.1, -0.39, -0.5), 240: (-0.4, 0.0, 0.5)}  # m, m, rad
"""Displacements of the robot before a step."""
MAX_WHEEL_ACCELERATION = 60.0  # rad/s^2


class Disc(NamedTuple):
    """An obstacle on the reference."""

    t: float
    """Time at which the reference passes it, in s."""
    left: float
    """Distance of its centre to the left of the reference at that time, in m."""
    drift: float = 0.0
    """Velocity to the left, in m/s."""
    distance: float = 0.3
    """Distance to keep from its centre, in m."""


OBSTACLES = (Disc(9.0, 0.15), Disc(18.0, -0.1, drift=-0.15), Disc(27.0, -0.15))

AnyProblem = UnicycleProblem | HolonomicProblem


class Bends:
    """Arcs, left and right alternately, at constant speed along the heading."""

    duration = 1e4  # longer than the stream, so that no horizon contains its end

    def at(self, t: float) -> Setpoint:
        x, y, yaw, *twist = self.window(t, 1, 0.0)[0].tolist()
        return Setpoint(Pose(x, y, yaw), WorldTwist(*twist))

    def window(self, t: float, n: int, dt: float) -> np.ndarray:
        rows = []
        for at in t + dt * np.arange(n):
            pose, left, side = Pose(0.0, 0.0, -0.5 * YAW_RATE * ARC), float(at), 1.0
            while left > ARC:
                pose = move(pose, BodyTwist(SPEED, 0.0, side * YAW_RATE), ARC)
                left, side = left - ARC, -side
            pose = move(pose, BodyTwist(SPEED, 0.0, side * YAW_RATE), left)
            speed = SPEED * np.cos(pose.yaw), SPEED * np.sin(pose.yaw)
            rows.append([*pose, *speed, side * YAW_RATE])
        return np.array(rows)


def obstacles(t: float, points: int, dt: float) -> list[KeepOutZone]:
    """Return the zones of :data:`OBSTACLES` at the times t, t + dt, ..."""
    return [
        KeepOutZone(
            _left_of_reference(passed, left + drift * (t - passed + dt * np.arange(points))),
            distance,
        )
        for passed, left, drift, distance in OBSTACLES
    ]


def _left_of_reference(t: float, left: np.ndarray) -> np.ndarray:
    x, y, yaw = Waves().at(t).pose
    return np.array([x, y]) + np.outer(left, [-np.sin(yaw), np.cos(yaw)])


class Waves:
    """A sine along x, driven along the heading; unlike in :class:`Bends`, velocities are smooth."""

    duration = 1e4

    def at(self, t: float) -> Setpoint:
        x, y, yaw, *twist = self.window(t, 1, 0.0)[0].tolist()
        return Setpoint(Pose(x, y, yaw), WorldTwist(*twist))

    def window(self, t: float, n: int, dt: float) -> np.ndarray:
        at = t + dt * np.arange(n)
        vx, vy = np.full(n, ADVANCE), WAVE * WAVE_RATE * np.cos(WAVE_RATE * at)
        yaw_rate = -vx * WAVE * WAVE_RATE**2 * np.sin(WAVE_RATE * at) / (vx**2 + vy**2)
        y, yaw = WAVE * np.sin(WAVE_RATE * at), np.arctan2(vy, vx)
        return np.column_stack([ADVANCE * at, y, yaw, vx, vy, yaw_rate])


@dataclass
class Recorder:
    """A solver that records its problems, with ``limits`` in place of theirs if given."""

    solver: Any
    limits: Limits | None = None
    problems: deque[Any] = field(default_factory=lambda: deque(maxlen=STEPS))
    """The last problems: the first calls of a controller only compile its kernels."""

    def solve(self, problem: AnyProblem, *guess: np.ndarray) -> Any:
        if self.limits is not None:
            problem = problem._replace(limits=self.limits)
        self.problems.append(deepcopy(problem))
        return self.solver.solve(problem, *guess)


def unicycle_stream(stages: int) -> list[UnicycleProblem]:
    """Return the problems of the paper's controller."""
    recorder = Recorder(UnicycleSolver())
    drive(UnicycleController(DT, stages, PRESETS["paper"], recorder), Bends())
    return list(recorder.problems)


def holonomic_stream(stages: int, max_wheel_speed: float) -> list[HolonomicProblem]:
    """Return the problems of the holonomic controller; robot ``paper``, slower wheels."""
    recorder = Recorder(HolonomicSolver())
    drive(holonomic_controller(stages, max_wheel_speed, recorder), Bends())
    return list(recorder.problems)


def obstacle_stream(stages: int, max_wheel_speed: float) -> list[HolonomicProblem]:
    """Return its problems among :data:`OBSTACLES`, with limited wheel accelerations."""
    wheels = named_robot("paper").chassis.jacobian
    limits = stack_limits(
        speed_limits(wheels, max_wheel_speed, DT), rate_limits(wheels, MAX_WHEEL_ACCELERATION, DT)
    )
    recorder = Recorder(HolonomicSolver(), limits)
    drive(holonomic_controller(stages, max_wheel_speed, recorder, obstacles), Waves())
    return list(recorder.problems)


def statement(problem: AnyProblem) -> dict[str, object]:
    """Return the data that all problems of a stream have in common: see nmpc_models.py."""
    common: dict[str, object] = {
        "model": "unicycle",
        "stages": len(problem.feedforward),
        "dt": problem.dt,
        "stage_weights": problem.state_weights[0].tolist(),
        "terminal_weights": problem.state_weights[-1].tolist(),
        "control_weights": np.asarray(problem.control_weights).tolist(),
    }
    if isinstance(problem, UnicycleProblem):
        return common | {"limits": list(problem.limits)}
    limits, zones = problem.limits, problem.keep_outs
    rows = {name: getattr(limits, name).tolist() for name in ("now", "before", "bounds")}
    zone_data = {"radii": zones.radii.tolist(), "weights": zones.weights.tolist()}
    return common | {"model": "holonomic"} | rows | zone_data


def numbers(problem: AnyProblem) -> dict[str, np.ndarray]:
    """Return the data that differ between the problems of a stream: see nmpc_models.py."""
    own = {name: getattr(problem, name) for name in ("start", "targets", "feedforward")}
    if isinstance(problem, UnicycleProblem):
        return own
    centres = np.hstack([np.empty((len(problem.targets), 0)), *problem.keep_outs.centres])
    return own | {"previous": problem.previous, "centres": centres}


def closed_loop_cost(stages: int, max_wheel_speed: float, solver: HolonomicOptimizer) -> float:
    """Return the sum of the stage costs of the true motion."""
    controller = holonomic_controller(stages, max_wheel_speed, solver)
    p, states = controller.parameters, drive(controller, Bends())
    targets = Bends().window(0.0, len(states), DT)[:, :3]
    return tracking_cost(
        states,
        targets.copy(),
        np.tile([p.position_weight, p.position_weight, p.heading_weight], (len(states), 1)),
        np.diff(states, axis=0) / DT,
        np.diff(targets, axis=0) / DT,
        np.array([p.velocity_weight, p.velocity_weight, p.yaw_rate_weight]),
    )


def holonomic_controller(
    stages: int,
    max_wheel_speed: float,
    solver: HolonomicOptimizer,
    keep_outs: KeepOutForecast | Sequence[KeepOutZone] = (),
) -> HolonomicController:
    chassis = replace(named_robot("paper"), max_wheel_speed=max_wheel_speed).chassis
    return holonomic_nmpc(chassis, DT, stages, solver=solver, keep_outs=keep_outs)


def drive(
    controller: UnicycleController | HolonomicController, reference: Bends | Waves
) -> np.ndarray:
    """Return the true poses of a robot with ideal actuators, noise and displacements."""
    rng = np.random.default_rng(SEED)
    pose = reference.at(0.0).pose
    controller.reset(State(0.0, pose))
    poses = [pose]
    for k in range(STEPS):
        if k in DISPLACEMENTS:
            pose = Pose(*np.add(pose, DISPLACEMENTS[k]).tolist())
        command = controller.step(k * DT, State(k * DT, measured(pose, rng)), reference)
        pose = move(pose, command.twist, DT)
        poses.append(pose)
    return np.array(poses)


def measured(pose: Pose, rng: np.random.Generator) -> Pose:
    noise = rng.normal(0.0, (POSITION_NOISE, POSITION_NOISE, HEADING_NOISE))
    return Pose(*np.add(pose, noise).tolist())
