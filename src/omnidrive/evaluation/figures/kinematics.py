"""Kinematic diagram of the robot."""

from __future__ import annotations

from math import cos, degrees, pi, sin

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from omnidrive.evaluation.figures.sketch import (
    angle,
    arrow,
    dimension,
    frame,
    note,
    place,
    robot_outline,
)
from omnidrive.evaluation.figures.style import FAINT, INK, canvas, diagram
from omnidrive.geometry import Pose
from omnidrive.robot import Robot

_BLUE, _GREEN, _RED, _PURPLE = "#0072b2", "#007a59", "#d55e00", "#a8558a"
_YAW = 0.35  # rad; heading of the drawn robot


def kinematics(robot: Robot) -> Figure:
    """The robot from above, to scale, and the velocity of one of its wheels."""
    figure = canvas(9.0, 4.3)
    above, wheel = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
    _above(above, robot)
    _wheel(wheel, robot)
    return figure


def _above(axes: Axes, robot: Robot) -> None:
    """Frames, wheels and dimensions."""
    pose, size = Pose(0.0, 0.0, _YAW), robot.body_radius
    diagram(axes)
    robot_outline(axes, robot, pose, INK, dashed=False)
    frame(axes, pose, 0.62 * size, ("$x_B$", "$y_B$"), _BLUE)
    world = Pose(-1.75 * size, -1.2 * size, 0.0)
    frame(axes, world, 0.45 * size, ("$x_W$", "$y_W$"), FAINT)
    axes.plot([0.0, 0.78 * size], [0.0, 0.0], color=FAINT, lw=0.8, ls=(0, (4, 2.5)), zorder=3)
    angle(axes, (0.0, 0.0), 0.42 * size, 0.0, _YAW, colour=FAINT)
    note(axes, (0.52 * size * cos(0.5 * _YAW), 0.52 * size * sin(0.5 * _YAW)), r"$\theta$")
    for k, mount in enumerate(robot.mounts):
        _drive(axes, robot, pose, k, mount.axle)
    first, last = robot.mounts[0].axle, robot.mounts[-1].axle
    angle(axes, (0.0, 0.0), 0.26 * size, _YAW, _YAW + first, colour=_GREEN)
    middle = _YAW + 0.5 * first
    note(axes, (0.36 * size * cos(middle), 0.36 * size * sin(middle)), r"$a_1$", colour=_GREEN)
    hub = place(pose, [(robot.arm * cos(last), robot.arm * sin(last))])[0]
    dimension(axes, (0.0, 0.0), (hub[0], hub[1]), f"R = {robot.arm:.4g} m", offset=0.07 * size)
    hub = place(pose, [(robot.arm * cos(first), robot.arm * sin(first))])[0]
    axes.plot([0.0, hub[0]], [0.0, hub[1]], color=_GREEN, lw=0.9, ls=(0, (2, 2)), zorder=3)
    axes.set_title(f"Robot '{robot.name}' from above, to scale", parse_math=False)
    axes.set(xlim=(-1.85 * size, 1.5 * size), ylim=(-1.62 * size, 1.3 * size))
    axes.text(0.0, -1.6 * size, _facts(robot), ha="center", va="bottom", fontsize=8)


def _facts(robot: Robot) -> str:
    bearings = ", ".join(f"{degrees(a):g}" for a in (mount.axle for mount in robot.mounts))
    return (
        f"wheel radius r = {robot.wheel.radius:.4g} m,  body radius {robot.body_radius:.4g} m\n"
        f"bearings $a_i$ = {bearings} degrees,  {robot.mass:g} kg"
    )


def _drive(axes: Axes, robot: Robot, pose: Pose, k: int, bearing: float) -> None:
    """Number of a wheel, and the direction in which it pushes when it turns forward."""
    size, turn = robot.body_radius, bearing + 0.5 * pi
    c, s = cos(bearing), sin(bearing)
    rim = 1.15 * robot.wheel.radius
    start = (robot.arm * c + rim * cos(turn), robot.arm * s + rim * sin(turn))
    end = (start[0] + 0.33 * size * cos(turn), start[1] + 0.33 * size * sin(turn))
    tail, tip, name, speed = place(
        pose,
        [start, end, (1.13 * size * c, 1.13 * size * s),
         (end[0] + 0.1 * size * cos(turn), end[1] + 0.1 * size * sin(turn))],
    ).tolist()  # fmt: skip
    arrow(axes, tuple(tail), tuple(tip), colour=_RED)
    note(axes, tuple(name), str(k + 1), size=10)
    note(axes, tuple(speed), rf"$v_{k + 1}$", colour=_RED)


def _wheel(axes: Axes, robot: Robot) -> None:
    """Velocity of the first wheel's hub, taken apart along its rolling direction."""
    diagram(axes)
    bearing = robot.mounts[0].axle
    turn = bearing + 0.5 * pi
    hub = Pose(0.0, 0.0, turn)
    corners = place(hub, [(0.34, 0.13), (-0.34, 0.13), (-0.34, -0.13), (0.34, -0.13)])
    axes.add_patch(Polygon(corners, facecolor="#e9edf2", edgecolor=INK, lw=1.0, zorder=2))
    rollers = [place(hub, [(x, 0.1), (x, -0.1)]) for x in (-0.24, -0.12, 0.0, 0.12, 0.24)]
    for ends in rollers:
        axes.plot(ends[:, 0], ends[:, 1], color=FAINT, lw=2.2, zorder=3)
    line, axle = place(hub, [(-1.5, 0.0), (1.5, 0.0)]), place(hub, [(0.0, -0.75), (0.0, 1.35)])
    axes.plot(line[:, 0], line[:, 1], color=_RED, lw=0.7, ls=(0, (2, 2)), zorder=1)
    axes.plot(axle[:, 0], axle[:, 1], color=_GREEN, lw=0.7, ls=(0, (2, 2)), zorder=1)
    label = "axle, to the centre;\nalong it the rollers give way"
    note(axes, (axle[1][0], axle[1][1] - 0.13), label, colour=_GREEN, size=8)
    _components(axes, bearing)
    axes.set_title("Velocity at wheel $i$")
    axes.set(xlim=(-1.5, 1.5), ylim=(-1.75, 1.45))
    axes.text(0.0, -1.72, r"$v_i = r\,\omega_i = -\sin(a_i)\,\dot{x} + \cos(a_i)\,\dot{y}"
              r" + R\,\dot{\theta}$", ha="center", va="bottom", fontsize=10.5)  # fmt: skip


def _components(axes: Axes, bearing: float) -> None:
    """Body velocity at the hub, its feet on the rolling direction, and the part of the turn."""
    along = (-sin(bearing), cos(bearing))
    parts = (
        ((0.95, 0.0), r"$\dot{x}$", _BLUE, (0.12, 0.0)),
        ((0.0, 0.95), r"$\dot{y}$", _PURPLE, (0.13, 0.0)),
    )
    for (x, y), name, colour, (dx, dy) in parts:
        arrow(axes, (0.0, 0.0), (x, y), colour=colour)
        note(axes, (x + dx, y + dy), name, colour=colour)
        share = x * along[0] + y * along[1]
        foot = (share * along[0], share * along[1])
        axes.plot([x, foot[0]], [y, foot[1]], color=colour, lw=0.8, ls=(0, (2, 2)), zorder=4)
    end = (1.55 * along[0], 1.55 * along[1])
    arrow(axes, (0.0, 0.0), end, colour=_RED)
    note(axes, (end[0] - 0.06, end[1] + 0.14), "$v_i$", colour=_RED)
    corner = Rectangle((0.0, 0.0), 0.1, 0.1, angle=degrees(bearing), fill=False, lw=0.7, ec=FAINT)
    axes.add_patch(corner)
