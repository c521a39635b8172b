"""Cameras for films, pictures and the viewer."""

from __future__ import annotations

from math import cos, radians, sin, tan
from typing import Literal, get_args

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.parameter import check_choice

CameraName = Literal["auto", "whole", "follow"]
"""`whole`: the picture contains the whole path; `follow`: the robot is at its centre; `auto`:
`whole`, or `follow` if the robot would be too small to see."""

_FIELD_OF_VIEW = 45.0  # degrees, vertical; MuJoCo's default
_FILL = 0.9  # largest share of the picture that the framed points fill
_MAX_OVERVIEW = 30.0  # robot radii; extent of the path beyond which `auto` follows the robot
_FOLLOW_DISTANCE = 11.0  # robot radii; distance of a camera that follows the robot
_NORTH = 90.0  # degrees; azimuth of a view along y of W, with x to the right


def is_following(name: CameraName, path: Float[Array, "points 2"], radius: float) -> bool:
    """Return whether the camera follows a robot of this radius (m) along its path (m, in W).

    Raises:
        InvalidInput: The name is unknown.
    """
    check_choice("camera", name, get_args(CameraName))
    length = float(np.hypot(*np.ptp(path, axis=0)))
    return name == "follow" or (name == "auto" and length > _MAX_OVERVIEW * radius)


def make_camera(
    name: CameraName, path: Float[Array, "points 2"], radius: float, aspect: float
) -> mujoco.MjvCamera:
    """Return a camera for a run along ``path``, at its first point.

    Args:
        name: Kind of camera.
        path: Points of the path in W, m.
        radius: Radius of the robot, m.
        aspect: Width of the picture divided by its height.

    Raises:
        InvalidInput: The name is unknown.
    """
    if not is_following(name, path, radius):
        return overview_camera(path, 1.3 * radius, aspect)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = _NORTH, -40.0, _FOLLOW_DISTANCE * radius
    follow(camera, path[0])
    return camera


def follow(camera: mujoco.MjvCamera, position: Float[Array, " 2"]) -> None:
    """Point the camera at a position (m, in W)."""
    camera.lookat[:] = *position, 0.0


def overview_camera(
    points: Float[Array, "points 2"], margin: float, aspect: float
) -> mujoco.MjvCamera:
    """Return the nearest camera from the south whose picture contains all ``points``.

    A point at (right, up, near) in the camera's frame, relative to the point that the camera is
    aimed at from distance d, is in the picture if ``|right| <= a t (d - near)`` and
    ``|up| <= t (d - near)``, where t is the tangent of half the field of view and a the aspect.

    Args:
        points: Points in W, m.
        margin: Margin around them, m.
        aspect: Width of the picture divided by its height.
    """
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    corners = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])])
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = _NORTH, -60.0
    follow(camera, 0.5 * (low + high))
    tilt, half = radians(camera.elevation), _FILL * tan(radians(0.5 * _FIELD_OF_VIEW))
    right, ahead = (corners - camera.lookat[:2]).T
    up, near = -sin(tilt) * ahead, -cos(tilt) * ahead
    camera.distance = float(max((np.abs(right) / aspect / half + near).max(),
                                (np.abs(up) / half + near).max()))  # fmt: skip
    return camera
