"""Recordings of runs, from which films are drawn."""

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
from omnidrive.visualization.display_model import DisplayModel, interpolate_pose
from omnidrive.visualization.observer import Scene
from omnidrive.visualization.overlays import sample_path

FRAMES_PER_SECOND = 25.0
"""Frame rate of films in real time; GIF measures intervals in hundredths of a second."""
MAX_FRAMES = 15_000
"""Largest number of frames of one run: ten minutes. Of a longer run every 2nd, 4th, ... is kept."""


@dataclass(frozen=True, eq=False, slots=True)
class Recording:
    """States of a MuJoCo model at equal intervals of time.

    Attributes:
        model: The model.
        radius: Radius of the robot, m.
        path: Points of the reference path in W, m.
        t: Time of each frame, s.
        qpos: MuJoCo's ``qpos`` of each frame; the first two are the position of the robot, m.
        mocap_positions: MuJoCo's ``mocap_pos`` of each frame: positions of moving obstacles, m.
        target: Reference pose of each frame; m, m, rad.
    """

    model: mujoco.MjModel
    radius: float
    path: Float[Array, "points 2"]
    t: Float[Array, " frames"]
    qpos: Float[Array, "frames nq"]
    mocap_positions: Float[Array, "frames moving 3"]
    target: Float[Array, "frames 3"]


class Recorder:
    """An :class:`~omnidrive.visualization.Observer` that records the states of a run.

    Recording takes hardly any time; :func:`~omnidrive.visualization.film` draws the recording.
    """

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._frames: list[tuple[float, Array, Array, Pose]] = []
        self._stride, self._updates = 1, 0

    @property
    def period(self) -> float:
        """Simulated time between frames, s."""
        return 1.0 / FRAMES_PER_SECOND

    def begin(self, scene: Scene) -> None:
        """Discard the previous recording."""
        self._scene = scene
        self._frames, self._stride, self._updates = [], 1, 0

    def update(self, t: float) -> None:
        """Record the state at ``t`` (s), unless it is not finite."""
        assert self._scene is not None
        data, due = self._scene.data, self._updates % self._stride == 0
        self._updates += 1
        if not due or not np.isfinite(data.qpos).all():
            return
        target = self._scene.reference.at(t).pose
        self._frames.append((t, data.qpos.copy(), data.mocap_pos.copy(), target))
        if len(self._frames) >= MAX_FRAMES:
            self._frames, self._stride = self._frames[::2], 2 * self._stride

    @property
    def recording(self) -> Recording:
        """The recording of the last run.

        Raises:
            InvalidInput: No run was recorded.
        """
        if self._scene is None:
            raise InvalidInput(
                "nothing was recorded: simulate a plant with this recorder (observe)"
            )
        times, qpos, mocap_positions, targets = zip(*self._frames, strict=True)
        return Recording(
            self._scene.model,
            self._scene.robot.body_radius,
            sample_path(self._scene.reference),
            np.array(times),
            np.array(qpos),
            np.array(mocap_positions),
            np.array(targets, dtype=float),
        )


def replay(
    run: Run,
    robot: Robot,
    *,
    obstacles: OccupancyGrid | None = None,
    moving: Sequence[MovingObstacle] = (),
) -> Recording:
    """Return a recording made from the log of a run, of a simulated or real robot.

    Poses are interpolated between the rows of the log; wheels roll without slip.

    Args:
        run: Log of the run.
        robot: The robot.
        obstacles: Map to draw.
        moving: Moving obstacles to draw.
    """
    display = DisplayModel(robot, obstacles=obstacles, moving=moving)
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
        angles.append(display.next_wheel_angles(states[k], states[k + 1], angles[k], dt))
    qpos, mocap_positions = [], []
    for t in times.tolist():
        k = min(max(int(np.searchsorted(run.t[:rows], t, side="right")) - 1, 0), max(rows - 2, 0))
        last = min(k + 1, rows - 1)
        dt = float(run.t[last] - run.t[k])
        part = min((t - float(run.t[k])) / dt, 1.0) if dt > 0.0 else 0.0
        wheels = angles[k] + part * (angles[last] - angles[k])
        display.set_pose(t, interpolate_pose(states[k], states[last], dt, part), wheels)
        qpos.append(display.data.qpos.copy())
        mocap_positions.append(display.data.mocap_pos.copy())
    target = np.column_stack([np.interp(times, run.t, column) for column in run.target.T])
    return Recording(
        display.model,
        robot.body_radius,
        run.target[:, :2].copy(),
        times,
        np.array(qpos),
        np.array(mocap_positions),
        target,
    )
