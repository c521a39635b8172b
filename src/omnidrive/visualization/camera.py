"""Where a run is seen from."""

from __future__ import annotations

from math import cos, radians, sin, tan
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

CameraName = Literal["auto", "whole", "follow"]
"""`whole`: all of the path is in the picture; `follow`: the robot is in the middle of it; `auto`:
`whole`, unless the robot were too small to see."""

_FIELD = 45.0  # degrees from the bottom of a picture to its top, as is MuJoCo's habit
_FULL = 0.9  # of the picture that what is framed may fill
_SMALL = 30.0  # robots' radii from end to end of a path that is too long to be seen whole
_CLOSE = 11.0  # robots' radii from a camera that follows
_NORTH = 90.0  # degrees; a camera that looks along y of W has x on the right


def follows(name: CameraName, path: Float[Array, "points 2"], radius: float) -> bool:
    """Whether a camera follows the robot of this radius (m) along its path (m, in W)."""
    length = float(np.hypot(*np.ptp(path, axis=0)))
    return name == "follow" or (name == "auto" and length > _SMALL * radius)


def make_camera(
    name: CameraName, path: Float[Array, "points 2"], radius: float, aspect: float
) -> mujoco.MjvCamera:
    """A camera for a robot that drives along ``path`` (m, in W), at its first point.

    Args:
        name: Which.
        path: Where the robot goes.
        radius: Of the robot, in m.
        aspect: Width of the picture by its height.
    """
    if not follows(name, path, radius):
        return frame(path, 1.3 * radius, aspect)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = _NORTH, -40.0, _CLOSE * radius
    follow(camera, path[0])
    return camera


def follow(camera: mujoco.MjvCamera, place: Float[Array, " 2"]) -> None:
    """Look at a place (m, in W)."""
    camera.lookat[:] = *place, 0.0


def frame(points: Float[Array, "points 2"], margin: float, aspect: float) -> mujoco.MjvCamera:
    """A camera above the south that sees all of ``points`` (m, in W), as near as can be.

    A point at (right, up, near) from the point looked at, as the camera sees it from a distance d,
    is in the picture if ``|right| <= a t (d - near)`` and ``|up| <= t (d - near)``, where t is the
    tangent of half the field of view and a the aspect.

    Args:
        points: What is seen.
        margin: Around them, in m.
        aspect: Width of the picture by its height.
    """
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    corners = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])])
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = _NORTH, -60.0
    follow(camera, 0.5 * (low + high))
    tilt, half = radians(camera.elevation), _FULL * tan(radians(0.5 * _FIELD))
    right, ahead = (corners - camera.lookat[:2]).T
    up, near = -sin(tilt) * ahead, -cos(tilt) * ahead
    camera.distance = float(max((np.abs(right) / aspect / half + near).max(),
                                (np.abs(up) / half + near).max()))  # fmt: skip
    return camera
