"""Drawings on the floor: the reference path, the trail of the robot and the target pose.

They are geoms of the picture only, not of the physics.
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
_MAX_POINTS = 200  # of a line
_PATH_HEIGHT, _TRAIL_HEIGHT = 0.004, 0.010  # m above the floor
_THICKNESS = 0.002  # m
_IDENTITY = np.eye(3).ravel()


class Overlays(NamedTuple):
    """Drawings on the floor for one picture."""

    path: Float[Array, "points 2"]
    """Points of the reference path in W, m."""
    trail: Float[Array, "rows 2"]
    """Past positions of B in W, m."""
    target: Pose
    """Reference pose of B."""
    radius: float
    """Radius of the robot, m; the width of lines is a sixteenth of it."""

    def add_to(self, scene: mujoco.MjvScene) -> None:
        """Append the geoms to the scene, up to its capacity."""
        width = self.radius / 16.0
        _add_line(scene, self.path, _PATH_HEIGHT, width, _PATH)
        _add_line(scene, self.trail, _TRAIL_HEIGHT, width, _TRAIL)
        x, y, yaw = self.target
        disc = np.array([self.radius, _PATH_HEIGHT, 0.0])
        _add(scene, mujoco.mjtGeom.mjGEOM_CYLINDER, disc, np.array([x, y, _PATH_HEIGHT]), _TARGET)
        ahead = self.radius * np.array([cos(yaw), sin(yaw), 0.0])
        start = np.array([x, y, 3.0 * _TRAIL_HEIGHT])
        arrow = _add(scene, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), start, (*_TARGET[:3], 1.0))
        if arrow is not None:
            mujoco.mjv_connector(
                arrow, mujoco.mjtGeom.mjGEOM_ARROW, 0.8 * width, start + ahead, start + 1.4 * ahead
            )


def sample_path(reference: Reference) -> Float[Array, "points 2"]:
    """Return points of the path of a reference in W, m."""
    rows = reference.window(0.0, _MAX_POINTS, reference.duration / (_MAX_POINTS - 1))
    return np.array(rows[:, :2])


def _add_line(
    scene: mujoco.MjvScene,
    points: Float[Array, "rows 2"],
    height: float,
    width: float,
    colour: tuple[float, float, float, float],
) -> None:
    """Add a ribbon through at most ``_MAX_POINTS`` points; equal points are skipped."""
    if len(points) < 2:
        return
    chosen = points[
        np.linspace(0, len(points) - 1, min(len(points), _MAX_POINTS)).round().astype(int)
    ]
    for (x, y), (dx, dy) in zip(
        chosen[:-1].tolist(), np.diff(chosen, axis=0).tolist(), strict=True
    ):
        length = hypot(dx, dy)
        if length == 0.0:
            continue
        size = np.array([0.5 * (length + width), 0.5 * width, 0.5 * _THICKNESS])
        middle = np.array([x + 0.5 * dx, y + 0.5 * dy, height])
        c, s = dx / length, dy / length
        rotation = np.array([c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0])
        _add(scene, mujoco.mjtGeom.mjGEOM_BOX, size, middle, colour, rotation=rotation)


def _add(
    scene: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    size: Float[Array, " 3"],
    position: Float[Array, " 3"],
    colour: tuple[float, float, float, float],
    *,
    rotation: Float[Array, " 9"] = _IDENTITY,
) -> mujoco.MjvGeom | None:
    """Append a geom; return None if the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    scene.ngeom += 1
    rgba = np.array(colour, dtype=np.float32)
    mujoco.mjv_initGeom(geom, kind, size, position, rotation, rgba)
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.emission = 0.2
    return geom
