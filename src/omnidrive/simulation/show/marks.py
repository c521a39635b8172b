"""What is drawn on the floor: the reference, the way driven so far, and where the robot should be.

They are geoms of the picture alone; the physics knows nothing of them.
"""

from __future__ import annotations

from itertools import pairwise
from math import cos, sin
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.geometry import Pose
from omnidrive.reference import Reference

Array = np.ndarray

_PATH = (0.12, 0.13, 0.16, 1.0)
_TRAIL = (0.93, 0.36, 0.06, 1.0)
_TARGET = (0.05, 0.62, 0.32, 0.45)
_POINTS = 200  # of a line, at most
_LOW, _ABOVE = 0.004, 0.010  # m above the floor


class Marks(NamedTuple):
    """What is drawn on the floor."""

    path: Float[Array, "points 2"]
    """Of the reference, in W, in m."""
    trail: Float[Array, "rows 2"]
    """Where B has been, in W, in m."""
    target: Pose
    """Where B should be now."""
    radius: float
    """Of the robot, in m; lines are a twentieth of it wide."""

    def add_to(self, scene: mujoco.MjvScene) -> None:
        """Add geoms to those that are in the picture already, as far as there is room."""
        width = 0.025 * self.radius
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
                arrow, mujoco.mjtGeom.mjGEOM_ARROW, 2.0 * width, start + ahead, start + 1.4 * ahead
            )


def path_of(reference: Reference) -> Float[Array, "points 2"]:
    """The way of a reference, in W, in m."""
    rows = reference.window(0.0, _POINTS, reference.duration / (_POINTS - 1))
    return np.array(rows[:, :2])


def _add_line(
    scene: mujoco.MjvScene,
    points: Float[Array, "rows 2"],
    height: float,
    radius: float,
    colour: tuple[float, float, float, float],
) -> None:
    """A line through at most as many points as there is room for; where it stands, none."""
    if len(points) < 2:
        return
    chosen = np.linspace(0, len(points) - 1, min(len(points), _POINTS)).round().astype(int)
    line = np.column_stack([points[chosen], np.full(len(chosen), height)])
    for begin, end in pairwise(line):
        if np.array_equal(begin, end):
            continue
        geom = _add(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), begin, colour)
        if geom is not None:
            mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, radius, begin, end)


def _add(
    scene: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    size: Float[Array, " 3"],
    place: Float[Array, " 3"],
    colour: tuple[float, float, float, float],
) -> mujoco.MjvGeom | None:
    """One geom, not turned; None if there is no room left."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    scene.ngeom += 1
    rgba = np.array(colour, dtype=np.float32)
    mujoco.mjv_initGeom(geom, kind, size, place, np.eye(3).ravel(), rgba)
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.emission = 0.5
    return geom
