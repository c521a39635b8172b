"""Drawing primitives of the diagrams: arrows, angles, frames and robots."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, degrees, hypot, pi, sin
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, FancyArrowPatch, Patch, Polygon

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import DARK, DASHED
from omnidrive.geometry import Pose
from omnidrive.robot import Mount, Robot

Point = tuple[float, float]


def transform_points(pose: Pose, points: Sequence[Point]) -> Float[Array, "points 2"]:
    """Transform points from the frame at ``pose`` to W; m."""
    c, s = cos(pose.yaw), sin(pose.yaw)
    return np.array([(pose.x + c * x - s * y, pose.y + s * x + c * y) for x, y in points])


def arrow(
    axes: Axes,
    tail: Point,
    tip: Point,
    *,
    colour: str = DARK,
    width: float = 1.3,
    style: str = "-|>",
) -> None:
    """Draw a straight arrow in data coordinates."""
    axes.add_patch(
        FancyArrowPatch(
            tail,
            tip,
            arrowstyle=style,
            mutation_scale=9,
            lw=width,
            color=colour,
            shrinkA=0,
            shrinkB=0,
            zorder=6,
        )
    )


def angle(axes: Axes, at: Point, radius: float, start: float, end: float, *, colour: str) -> None:
    """Draw an arc from angle ``start`` to ``end`` (rad, counter-clockwise) with an arrow head."""
    axes.add_patch(
        Arc(
            at,
            2 * radius,
            2 * radius,
            theta1=degrees(start),
            theta2=degrees(end),
            color=colour,
            lw=1.1,
            zorder=5,
        )
    )
    tip = (at[0] + radius * cos(end), at[1] + radius * sin(end))
    back = end - 0.05 / radius * 0.6
    tail = (at[0] + radius * cos(back), at[1] + radius * sin(back))
    arrow(axes, tail, tip, colour=colour, width=1.1)


def dimension(axes: Axes, start: Point, end: Point, text: str, *, offset: float) -> None:
    """Draw a dimension line with its text at ``offset`` to the left of its direction."""
    arrow(axes, start, end, width=0.9, style="<|-|>")
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = hypot(dx, dy)
    turn = degrees(atan2(dy, dx))
    x = 0.5 * (start[0] + end[0]) - offset * dy / length
    y = 0.5 * (start[1] + end[1]) + offset * dx / length
    upright = (turn + 90.0) % 180.0 - 90.0
    axes.text(x, y, text, ha="center", va="center", rotation=upright, rotation_mode="anchor")


def annotate(axes: Axes, at: Point, text: str, *, colour: str = DARK, size: float = 9.5) -> None:
    """Draw text with formulas centred at a point, on a white background."""
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8}
    axes.text(
        *at,
        text,
        color=colour,
        ha="center",
        va="center",
        size=size,
        zorder=9,
        bbox=box,
        parse_math=True,
    )


def frame(axes: Axes, pose: Pose, length: float, names: tuple[str, str], colour: str) -> None:
    """Draw the two axes of a frame."""
    origin, x, y, x_name, y_name = transform_points(
        pose, [(0, 0), (length, 0), (0, length), (1.13 * length, 0), (0, 1.13 * length)]
    ).tolist()
    arrow(axes, tuple(origin), tuple(x), colour=colour)
    arrow(axes, tuple(origin), tuple(y), colour=colour)
    annotate(axes, tuple(x_name), names[0], colour=colour)
    annotate(axes, tuple(y_name), names[1], colour=colour)


def body_patch(robot: Robot, pose: Pose, **style: Any) -> Patch:
    """Return the outline of a robot at a pose or, without one, its body circle."""
    if robot.outline is None:
        return Circle((pose.x, pose.y), robot.body_radius, **style)
    return Polygon(transform_points(pose, robot.outline), **style)


def robot_outline(axes: Axes, robot: Robot, pose: Pose, colour: str, *, dashed: bool) -> None:
    """Draw outline or body circle, and wheels, to scale."""
    style = DASHED if dashed else "-"
    body = body_patch(
        robot, pose, fill=not dashed, facecolor="#f3f5f8", edgecolor=colour, lw=1.2, ls=style,
        zorder=2,
    )  # fmt: skip
    axes.add_patch(body)
    for mount in robot.mounts:
        wheel_outline(axes, robot, pose, mount, colour)


def wheel_outline(axes: Axes, robot: Robot, pose: Pose, mount: Mount, colour: str) -> None:
    """Draw one wheel from above."""
    centre = transform_points(pose, [(mount.x, mount.y)])[0]
    wheel = Pose(float(centre[0]), float(centre[1]), pose.yaw + mount.axle_angle + 0.5 * pi)
    r, half = robot.wheel.radius, 0.5 * robot.wheel.row_gap + 0.4 * robot.wheel.radius
    corners = transform_points(wheel, [(r, half), (-r, half), (-r, -half), (r, -half)])
    tyre = Polygon(corners, facecolor=colour, edgecolor=DARK, lw=0.8, zorder=4)
    axes.add_patch(tyre)
    if mount.is_mecanum:
        slant = half * cos(mount.roller_angle) / sin(mount.roller_angle)
        for middle in (-r, -0.5 * r, 0.0, 0.5 * r, r):  # uppermost rollers
            ends = transform_points(wheel, [(middle + slant, half), (middle - slant, -half)])
            axes.plot(*ends.T, color="white", lw=0.9, zorder=4.5, clip_path=tyre)
