"""Many runs of the planar robot at once."""

from __future__ import annotations

from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.parameter import check_sample_time
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.planar.dynamics import drive
from omnidrive.simulation.planar.model import model_of
from omnidrive.simulation.planar.plant import TIMESTEP
from omnidrive.simulation.planar.state import State


def roll_out(
    robot: Robot,
    starts: Float[Array, "starts 3"],
    commands: Float[Array, "runs steps 3"],
    dt: float,
    *,
    timestep: float = TIMESTEP,
) -> tuple[Float[Array, "runs steps 3"], Float[Array, "runs steps 3"]]:
    """What :class:`PlanarPlant` does from rest under series of commands, bit for bit.

    It runs on one core, without the interpreter's lock: threads can share the runs.

    Args:
        robot: What moves.
        starts: Poses at which it stands at first: m, m, rad.
        commands: Body twists, each held for ``dt``: m/s, m/s, rad/s.
        dt: In s.
        timestep: Longest step of the dynamics, in s.

    Returns:
        Poses and body twists after every command.

    Raises:
        InvalidInput: There are more or fewer starts than runs, or ``dt`` is not positive.
    """
    if len(starts) != len(commands):
        raise InvalidInput(f"there are {len(starts)} starts for {len(commands)} runs")
    check_sample_time(dt)
    starts, commands = (np.ascontiguousarray(a, dtype=float) for a in (starts, commands))
    steps = ceil(dt / timestep - 1e-9)
    poses, twists = np.empty(commands.shape), np.empty(commands.shape)
    state = State.at_rest(len(robot.mounts), robot.wheel.rollers, Pose(0.0, 0.0, 0.0))
    _roll_out(
        *model_of(robot, Disturbances()), *state,
        starts, commands, dt / steps, steps, poses, twists,
    )  # fmt: skip
    return poses, twists


@compiled
def _roll_out(  # noqa: PLR0917
    frame: Array,
    wheels: Array,
    motion: Array,
    spins: Array,
    rollers: Float[Array, "wheels rollers"],
    starts: Float[Array, "runs 3"],
    commands: Float[Array, "runs steps 3"],
    h: float,
    steps: int,
    poses: Float[Array, "runs steps 3"],
    twists: Float[Array, "runs steps 3"],
) -> None:
    still, stopped = motion.copy(), spins.copy()
    for run in range(len(commands)):
        motion[:], spins[:], rollers[:] = still, stopped, 0.0
        body = motion[0]
        body.x, body.y, body.yaw = starts[run, 0], starts[run, 1], starts[run, 2]
        for k in range(commands.shape[1]):
            vx, vy, yaw_rate = commands[run, k, 0], commands[run, k, 1], commands[run, k, 2]
            drive(frame, wheels, motion, spins, rollers, vx, vy, yaw_rate, h, steps)
            poses[run, k, 0], poses[run, k, 1], poses[run, k, 2] = body.x, body.y, body.yaw
            twists[run, k, 0], twists[run, k, 1] = body.vx, body.vy
            twists[run, k, 2] = body.yaw_rate
