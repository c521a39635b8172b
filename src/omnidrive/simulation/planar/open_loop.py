"""Open-loop runs of the planar plant."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.parameter import check_sample_time
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.planar.dynamics import integrate
from omnidrive.simulation.planar.model import planar_model
from omnidrive.simulation.planar.plant import TIMESTEP
from omnidrive.simulation.planar.state import PlanarState
from omnidrive.simulation.plant import count_steps


def simulate_commands(
    robot: Robot,
    starts: Float[Array, "starts 3"],
    commands: Float[Array, "runs steps 3"],
    dt: float,
    *,
    timestep: float = TIMESTEP,
) -> tuple[Float[Array, "runs steps 3"], Float[Array, "runs steps 3"]]:
    """Simulate sequences of commands from rest, with the same bits as :class:`PlanarPlant`.

    It uses one core and releases the global interpreter lock, so that threads can share the runs.

    Args:
        robot: The robot.
        starts: Initial pose of each run; m, m, rad.
        commands: Body twists, each held for ``dt``; m/s, m/s, rad/s.
        dt: Sample time, s.
        timestep: Longest integration step, s.

    Returns:
        Pose and body twist after every command.

    Raises:
        InvalidInput: The numbers of starts and of runs differ, or ``dt`` is not 1e-9 to 3600.
    """
    if len(starts) != len(commands):
        raise InvalidInput(f"there are {len(starts)} starts for {len(commands)} runs")
    check_sample_time(dt)
    starts, commands = (np.ascontiguousarray(a, dtype=float) for a in (starts, commands))
    steps = count_steps(dt, timestep)
    poses, twists = np.empty(commands.shape), np.empty(commands.shape)
    state = PlanarState.at_rest(len(robot.mounts), robot.wheel.rollers, Pose(0.0, 0.0, 0.0))
    _simulate(
        *planar_model(robot, Disturbances()), *state,
        starts, commands, dt / steps, steps, poses, twists,
    )  # fmt: skip
    return poses, twists


@compiled
def _simulate(  # noqa: PLR0917
    bodies: Array,
    wheels: Array,
    motion: Array,
    wheel_states: Array,
    rollers: Float[Array, "wheels rollers"],
    starts: Float[Array, "runs 3"],
    commands: Float[Array, "runs steps 3"],
    h: float,
    steps: int,
    poses: Float[Array, "runs steps 3"],
    twists: Float[Array, "runs steps 3"],
) -> None:
    initial_motion, initial_wheels = motion.copy(), wheel_states.copy()
    for run in range(len(commands)):
        motion[:], wheel_states[:], rollers[:] = initial_motion, initial_wheels, 0.0
        body = motion[0]
        body.x, body.y, body.yaw = starts[run, 0], starts[run, 1], starts[run, 2]
        for k in range(commands.shape[1]):
            vx, vy, yaw_rate = commands[run, k, 0], commands[run, k, 1], commands[run, k, 2]
            integrate(bodies, wheels, motion, wheel_states, rollers, vx, vy, yaw_rate, h, steps)
            poses[run, k, 0], poses[run, k, 1], poses[run, k, 2] = body.x, body.y, body.yaw
            twists[run, k, 0], twists[run, k, 1] = body.vx, body.vy
            twists[run, k, 2] = body.yaw_rate
