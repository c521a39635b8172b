"""What was seen of a run, kept so that it can be drawn afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.plant import PlantState
from omnidrive.simulation.run import Run
from omnidrive.visualization.ghost_model import GhostModel, interpolate_pose
from omnidrive.visualization.observer import Scene
from omnidrive.visualization.overlays import sample_path

FRAMES_PER_SECOND = 25.0
"""Of films at real time: GIF counts in hundredths of a second."""
MAX_FRAMES = 15_000
"""That are kept of one run: ten minutes. Of a longer one every second, or fourth, and so on."""


@dataclass(frozen=True, eq=False, slots=True)
class Recording:
    """States of a world, evenly spaced in time.

    Attributes:
        model: The world.
        radius: Of the robot, in m.
        path: Of the reference, in W, in m.
        t: Time of each frame, in s.
        places: MuJoCo's positions (``qpos``) in each; the first two are the robot's, in m.
        moving: Of moving obstacles.
        target: Where the robot should be, in m, m, rad.
    """

    model: mujoco.MjModel
    radius: float
    path: Float[Array, "points 2"]
    t: Float[Array, " frames"]
    positions: Float[Array, "frames nq"]
    moving: Float[Array, "frames moving 3"]
    target: Float[Array, "frames 3"]


class Recorder:
    """An :class:`~omnidrive.visualization.Observer` that keeps what it sees.

    It costs a run next to nothing; :func:`~omnidrive.visualization.film` draws it afterwards.
    """

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._frames: list[tuple[float, Array, Array, Pose]] = []
        self._stride, self._looks = 1, 0

    @property
    def period(self) -> float:
        """Simulated time between frames, in s."""
        return 1.0 / FRAMES_PER_SECOND

    def begin(self, scene: Scene) -> None:
        """Forget what was seen before."""
        self._scene = scene
        self._frames, self._stride, self._looks = [], 1, 0

    def update(self, t: float) -> None:
        """Keep the scene as it is at ``t`` (s), unless it is not finite."""
        assert self._scene is not None
        data, due = self._scene.data, self._looks % self._stride == 0
        self._looks += 1
        if not due or not np.isfinite(data.qpos).all():
            return
        target = self._scene.reference.at(t).pose
        self._frames.append((t, data.qpos.copy(), data.mocap_pos.copy(), target))
        if len(self._frames) >= MAX_FRAMES:
            self._frames, self._stride = self._frames[::2], 2 * self._stride

    @property
    def recording(self) -> Recording:
        """What was seen of the last run.

        Raises:
            InvalidInput: There was none.
        """
        if self._scene is None:
            raise InvalidInput("nothing was recorded: simulate a plant that this recorder watches")
        times, positions, moving, targets = zip(*self._frames, strict=True)
        return Recording(
            self._scene.model,
            self._scene.robot.body_radius,
            sample_path(self._scene.reference),
            np.array(times),
            np.array(positions),
            np.array(moving),
            np.array(targets, dtype=float),
        )


def replay(
    run: Run,
    robot: Robot,
    *,
    obstacles: OccupancyGrid | None = None,
    moving: Sequence[MovingObstacle] = (),
) -> Recording:
    """A recording made from the log of a run: of any plant, also a real robot.

    The poses are the log's, interpolated; wheels turn as if they did not slip.

    Args:
        run: What was done.
        robot: By whom.
        obstacles: The map that stands around it.
        moving: What moves there.
    """
    puppet = GhostModel(robot, obstacles=obstacles, moving=moving)
    finite = np.isfinite(run.pose).all(axis=1) & np.isfinite(run.twist).all(axis=1)
    rows = len(run.t) if finite.all() else max(int(np.argmin(finite)), 1)
    frames = min(round((run.t[rows - 1] - run.t[0]) * FRAMES_PER_SECOND) + 1, MAX_FRAMES)
    times = np.linspace(run.t[0], run.t[rows - 1], frames)
    states = [
        PlantState(Pose(*pose), BodyTwist(*twist), 0.0)
        for pose, twist in zip(run.pose[:rows].tolist(), run.twist[:rows].tolist(), strict=True)
    ]
    angles = [np.zeros(len(robot.mounts))]
    for k, dt in enumerate(np.diff(run.t[:rows]).tolist()):
        angles.append(puppet.turn_wheels(states[k], states[k + 1], angles[k], dt))
    positions, moved = [], []
    for t in times.tolist():
        k = min(max(int(np.searchsorted(run.t[:rows], t, side="right")) - 1, 0), max(rows - 2, 0))
        last = min(k + 1, rows - 1)
        dt = float(run.t[last] - run.t[k])
        part = min((t - float(run.t[k])) / dt, 1.0) if dt > 0.0 else 0.0
        wheels = angles[k] + part * (angles[last] - angles[k])
        puppet.set_pose(t, interpolate_pose(states[k], states[last], dt, part), wheels)
        positions.append(puppet.data.qpos.copy())
        moved.append(puppet.data.mocap_pos.copy())
    target = np.column_stack([np.interp(times, run.t, column) for column in run.target.T])
    return Recording(
        puppet.model,
        robot.body_radius,
        run.target[:, :2].copy(),
        times,
        np.array(positions),
        np.array(moved),
        target,
    )
