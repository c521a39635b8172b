"""Diagram of the tracking error."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.evaluation.figures.primitives import angle, annotate, arrow, robot_outline
from omnidrive.evaluation.figures.style import (
    BLUE,
    COLUMN,
    DARK,
    DASHED,
    DOTTED,
    GREEN,
    MUTED,
    RED,
    hide_axes,
    new_figure,
)
from omnidrive.geometry import Pose
from omnidrive.robot import Robot


def tracking_error(robot: Robot) -> Figure:
    """Draw the robot, its target on the path, and the errors between them."""
    size = robot.body_radius
    figure = new_figure(COLUMN, 2.9)
    axes = figure.subplots()
    hide_axes(axes)
    here = Pose(0.0, 0.0, 0.3)
    there = Pose(2.6 * size, 1.9 * size, 1.0)
    arc = [(0.1 * k - 2.6) for k in range(45)]
    path = [_arc(there, 3.4 * size, s * size) for s in arc]
    axes.plot(*zip(*path, strict=True), color=MUTED, lw=1.2, ls=DASHED, zorder=1)
    robot_outline(axes, robot, here, BLUE, dashed=False)
    robot_outline(axes, robot, there, DARK, dashed=True)
    for pose, colour, name in ((here, BLUE, r"$\theta$"), (there, DARK, r"$\theta_{ref}$")):
        _heading(axes, pose, size, colour, name)
    _errors(axes, here, there, size)
    annotate(axes, (here.x - 0.55 * size, here.y - 1.2 * size), "robot  $(x, y)$", colour=BLUE)
    annotate(axes, (there.x - 0.6 * size, there.y + 1.22 * size), "target  $(x_{ref}, y_{ref})$")
    axes.set(xlim=(-1.4 * size, 4.4 * size), ylim=(-1.5 * size, 3.4 * size))
    return figure


def _arc(pose: Pose, radius: float, s: float) -> tuple[float, float]:
    """Return the point at arc length ``s`` (m) on a left-hand circle tangent to ``pose``."""
    turn = s / radius
    return (
        pose.x + radius * (sin(pose.yaw + turn) - sin(pose.yaw)),
        pose.y - radius * (cos(pose.yaw + turn) - cos(pose.yaw)),
    )


def _heading(axes: Axes, pose: Pose, size: float, colour: str, name: str) -> None:
    tip = (pose.x + 1.15 * size * cos(pose.yaw), pose.y + 1.15 * size * sin(pose.yaw))
    axes.plot([pose.x, pose.x + 1.2 * size], [pose.y, pose.y], color=MUTED, lw=0.7)
    arrow(axes, (pose.x, pose.y), tip, colour=colour, width=1.6)
    angle(axes, (pose.x, pose.y), 0.75 * size, 0.0, pose.yaw, colour=colour)
    middle = 0.5 * pose.yaw
    annotate(axes, (pose.x + 0.6 * size * cos(middle), pose.y + 0.6 * size * sin(middle)), name,
         colour=colour)  # fmt: skip


def _errors(axes: Axes, here: Pose, there: Pose, size: float) -> None:
    """Draw distance and direction to the target, and their components along x and y."""
    dx, dy = there.x - here.x, there.y - here.y
    bearing, distance = atan2(dy, dx), hypot(dx, dy)
    corner = (there.x, here.y)
    axes.plot([here.x, *corner[:1]], [here.y, *corner[1:]], color=RED, lw=0.9, ls=DOTTED)
    axes.plot([corner[0], there.x], [corner[1], there.y], color=RED, lw=0.9, ls=DOTTED)
    annotate(axes, (here.x + 0.62 * dx, here.y - 0.14 * size), "$e_x$", colour=RED)
    annotate(axes, (corner[0] + 0.18 * size, here.y + 0.3 * dy), "$e_y$", colour=RED)
    arrow(axes, (here.x, here.y), (there.x, there.y), colour=RED)
    side = bearing + 0.5 * pi
    x = here.x + 0.5 * dx + 0.17 * size * cos(side)
    y = here.y + 0.5 * dy + 0.17 * size * sin(side)
    annotate(axes, (x, y), "$dr$", colour=RED)
    angle(axes, (here.x, here.y), 0.42 * distance, here.yaw, bearing, colour=GREEN)
    middle = 0.5 * (bearing + here.yaw)
    annotate(axes, (here.x + 0.48 * distance * cos(middle), here.y + 0.48 * distance * sin(middle)),
         r"$d\alpha$", colour=GREEN)  # fmt: skip
