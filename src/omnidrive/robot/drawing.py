"""Small drawing of a robot for notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin

import numpy as np

from omnidrive.notebook import BLUE, ORANGE, Drawing
from omnidrive.robot.mount import Mount
from omnidrive.robot.outline import Outline


def robot_svg(
    mounts: Sequence[Mount],
    wheel_radius: float,
    body_radius: float,
    outline: Outline | None = None,
) -> str:
    """Return the robot from above, x of B upwards: body, wheels and directions of their forces.

    Args:
        mounts: Mount of each wheel, in B.
        wheel_radius: Radius of the wheels, m.
        body_radius: Radius of the circle around the robot, m.
        outline: Corners of the body in B, m; None: the circle.
    """
    size = 1.12 * body_radius
    drawing = Drawing((-size, size, -size, size), width=140.0)
    if outline is None:
        drawing.circle((0.0, 0.0), body_radius)
    else:
        drawing.line(_turned([*outline, outline[0]]), width=1.0)
    drawing.line(_turned([(0.0, 0.0), (0.45 * body_radius, 0.0)]), width=1.0)
    for mount in mounts:
        bearing = mount.axle_angle + 0.5 * pi
        along, across = (
            wheel_radius * np.array([cos(a), sin(a)]) for a in (bearing, mount.axle_angle)
        )
        centre = np.array([mount.x, mount.y])
        corners = [centre + i * along + 0.4 * j * across for i, j in _CORNERS]
        drawing.polygon(_turned(corners), BLUE)
        force = 0.3 * body_radius * np.array(mount.drive_direction)
        drawing.line(_turned([centre, centre + force]), ORANGE, width=2.0)
    return drawing.svg()


_CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def _turned(points: Sequence[Sequence[float] | np.ndarray]) -> np.ndarray:
    """Turn points (x, y) in B by a quarter, so that x of B points upwards."""
    x, y = np.array(points, dtype=float).T
    return np.column_stack([-y, x])
