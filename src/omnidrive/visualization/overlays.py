"""What is drawn on the floor: the reference, the way driven so far, and where the robot should be.

They are geoms of the picture alone; the physics knows nothing of them.
"""

from __future__ import annotations

from math import cos, hypot, sin
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose
from omnidrive.reference import Reference

_PATH = (0.12, 0.13, 0.16, 1.0)
_TRAIL = (0.93, 0.36, 0.06, 1.0)
_TARGET = (0.05, 0.62, 0.32, 0.45)
_POINTS = 200  # of a line, at most
_LOW, _ABOVE = 0.004, 0.010  # m above the floor
_THIN = 0.002  # m
_NOT_TURNED = np.eye(3).ravel()


class Overlays(NamedTuple):
    """What is drawn on the floor."""

    path: Float[Array, "points 2"]
    """Of the reference, in W, in m."""
    trail: Float[Array, "rows 2"]
    """Where B has been, in W, in m."""
    target: Pose
    """Where B should be now."""
    radius: float
    """Of the robot, in m; lines are a sixteenth of it wide."""

    def add_to(self, scene: mujoco.MjvScene) -> None:
        """Add geoms to those that are in the picture already, as far as there is room."""
        width = self.radius / 16.0
        _add_line(scene, self.path, _LOW, width, _PATH)
        _add_line(scene, self.trail, _ABOVE, width, _TRAIL)
        x, y, yaw = self.target
        disc = np.array([self.radius, _LOW, 0.0])
        _add(scene, mujoco.mjtGeom.mjGEOM_CYLINDER, disc, np.array([x, y, _LOW]), _TARGET)
        ahead = self.radius * np.array([cos(yaw), sin(yaw), 0.0])
        start = np.array([x, y, 3.0 * _ABOVE])
        arrow = _add(scene, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), start, (*_TARGET[:3], 1.0))
        if arrow is not None:
            mujoco.mjv_connector(
                arrow, mujoco.mjtGeom.mjGEOM_ARROW, 0.8 * width, start + ahead, start + 1.4 * ahead
            )


def sample_path(reference: Reference) -> Float[Array, "points 2"]:
    """The way of a reference, in W, in m."""
    rows = reference.window(0.0, _POINTS, reference.duration / (_POINTS - 1))
    return np.array(rows[:, :2])


def _add_line(
    scene: mujoco.MjvScene,
    points: Float[Array, "rows 2"],
    height: float,
    width: float,
    colour: tuple[float, float, float, float],
) -> None:
    """A ribbon through at most as many points as there is room for; where it stands, none."""
    if len(points) < 2:
        return
    chosen = points[np.linspace(0, len(points) - 1, min(len(points), _POINTS)).round().astype(int)]
    for (x, y), (dx, dy) in zip(
        chosen[:-1].tolist(), np.diff(chosen, axis=0).tolist(), strict=True
    ):
        length = hypot(dx, dy)
        if length == 0.0:
            continue
        size = np.array([0.5 * (length + width), 0.5 * width, 0.5 * _THIN])
        middle = np.array([x + 0.5 * dx, y + 0.5 * dy, height])
        c, s = dx / length, dy / length
        turned = np.array([c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0])
        _add(scene, mujoco.mjtGeom.mjGEOM_BOX, size, middle, colour, turned=turned)


def _add(
    scene: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    size: Float[Array, " 3"],
    place: Float[Array, " 3"],
    colour: tuple[float, float, float, float],
    *,
    turned: Float[Array, " 9"] = _NOT_TURNED,
) -> mujoco.MjvGeom | None:
    """One geom; None if there is no room left."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    scene.ngeom += 1
    rgba = np.array(colour, dtype=np.float32)
    mujoco.mjv_initGeom(geom, kind, size, place, turned, rgba)
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.emission = 0.2
    return geom
