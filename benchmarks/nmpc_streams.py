"""The problems that a robot meets on an S-shaped way, with noise and kicks: the NMPC streams."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from omnidrive.control.nmpc import PRESETS, NmpcController, Problem, SqpSolver
from omnidrive.control.nmpc.cost import tracking_cost
from omnidrive.control.nmpc.holonomic import (
    HolonomicController,
    HolonomicParameters,
    HolonomicPlanner,
    HolonomicProblem,
    HolonomicSolver,
)
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, move
from omnidrive.reference import Setpoint
from omnidrive.robot import named_robot

DT, STEPS = 0.1, 300
SPEED, YAW_RATE, ARC = 0.7, 0.5, 6.0  # m/s, rad/s, seconds from one bend to the next
POSITION_NOISE, HEADING_NOISE, SEED = 0.01, 0.02, 1  # m, rad
KICKS = {60: (0.3, 0.27, 0.5), 150: (-0.1, -0.39, -0.5), 240: (-0.4, 0.0, 0.5)}  # m, m, rad
"""By how much the robot is displaced before a step."""

AnyProblem = Problem | HolonomicProblem


class Bends:
    """An S and another: arcs, left and right in turn, driven at one speed along the heading."""

    duration = 1e4  # it goes on beyond the stream, so that no horizon sees its end

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


@dataclass
class Recorder:
    """A solver that keeps the problems it was given."""

    solver: Any
    problems: list[Any] = field(default_factory=list)

    def solve(self, problem: AnyProblem, *guess: np.ndarray) -> Any:
        self.problems.append(deepcopy(problem))
        return self.solver.solve(problem, *guess)


def unicycle_stream(stages: int) -> list[Problem]:
    """What the paper's controller is asked in every step."""
    recorder = Recorder(SqpSolver())
    drive(NmpcController(DT, stages, PRESETS["paper"], recorder))
    return recorder.problems


def holonomic_stream(stages: int, max_wheel_speed: float) -> list[HolonomicProblem]:
    """What the controller within the wheels' limits is asked; robot ``paper``, slower wheels."""
    recorder = Recorder(HolonomicSolver())
    drive(holonomic_controller(stages, max_wheel_speed, recorder))
    return recorder.problems


def statement(problem: AnyProblem) -> dict[str, object]:
    """What all problems of its stream have in common: see nmpc_models.py."""
    common: dict[str, object] = {
        "model": "unicycle",
        "stages": len(problem.feedforward),
        "dt": problem.dt,
        "stage_weights": problem.state_weights[0].tolist(),
        "terminal_weights": problem.state_weights[-1].tolist(),
        "control_weights": problem.control_weights.tolist(),
        "limits": problem.limits.tolist(),
    }
    if isinstance(problem, HolonomicProblem):
        common |= {"model": "holonomic", "wheels": problem.wheels.tolist()}
    return common


def closed_loop_cost(stages: int, max_wheel_speed: float, solver: HolonomicPlanner) -> float:
    """Sum of the stage costs of what the robot truly did."""
    controller = holonomic_controller(stages, max_wheel_speed, solver)
    p, states = controller.parameters, drive(controller)
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
    stages: int, max_wheel_speed: float, solver: HolonomicPlanner
) -> HolonomicController:
    chassis = replace(named_robot("paper"), max_wheel_speed=max_wheel_speed).chassis
    return HolonomicController(DT, stages, HolonomicParameters(), chassis, solver)


def drive(controller: NmpcController | HolonomicController) -> np.ndarray:
    """True poses of a robot that moves as it is told, measured with noise, and kicked."""
    rng, reference = np.random.default_rng(SEED), Bends()
    pose = reference.at(0.0).pose
    controller.reset(pose)
    poses = [pose]
    for k in range(STEPS):
        if k in KICKS:
            pose = Pose(*np.add(pose, KICKS[k]).tolist())
        command = controller.step(k * DT, measured(pose, rng), reference)
        pose = move(pose, command.twist, DT)
        poses.append(pose)
    return np.array(poses)


def measured(pose: Pose, rng: np.random.Generator) -> Pose:
    noise = rng.normal(0.0, (POSITION_NOISE, POSITION_NOISE, HEADING_NOISE))
    return Pose(*np.add(pose, noise).tolist())
