"""Kinematic diagram of the robot."""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, isclose, pi, sin, tan

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from omnidrive.evaluation.figures.primitives import (
    angle,
    annotate,
    arrow,
    dimension,
    frame,
    robot_outline,
    transform_points,
)
from omnidrive.evaluation.figures.style import (
    BLUE,
    DARK,
    DASHED,
    DOTTED,
    GREEN,
    MUTED,
    PAGE,
    PURPLE,
    RED,
    hide_axes,
    new_figure,
)
from omnidrive.geometry import Pose
from omnidrive.robot import Mount, Robot

_YAW = 0.35  # rad; heading of the drawn robot


def kinematics(robot: Robot) -> Figure:
    """Draw the robot from above, to scale, and the velocity of one wheel."""
    figure = new_figure(PAGE, 3.7)
    above, wheel = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
    _above(above, robot)
    _wheel(wheel, robot)
    return figure


def _above(axes: Axes, robot: Robot) -> None:
    """Draw frames, wheels and dimensions."""
    pose, size = Pose(0.0, 0.0, _YAW), robot.body_radius
    hide_axes(axes)
    robot_outline(axes, robot, pose, DARK, dashed=False)
    frame(axes, pose, 0.62 * size, ("$x_B$", "$y_B$"), BLUE)
    world = Pose(-1.75 * size, -1.2 * size, 0.0)
    frame(axes, world, 0.45 * size, ("$x_W$", "$y_W$"), MUTED)
    axes.plot([0.0, 0.78 * size], [0.0, 0.0], color=MUTED, lw=0.8, ls=DASHED, zorder=3)
    angle(axes, (0.0, 0.0), 0.42 * size, 0.0, _YAW, colour=MUTED)
    annotate(axes, (0.52 * size * cos(0.5 * _YAW), 0.52 * size * sin(0.5 * _YAW)), r"$\theta$")
    for k, mount in enumerate(robot.mounts):
        _drive(axes, robot, pose, k, mount)
    first, last = (transform_points(pose, [robot.mounts[k][:2]])[0].tolist() for k in (0, -1))
    bearing = atan2(first[1], first[0])
    angle(axes, (0.0, 0.0), 0.26 * size, _YAW, bearing, colour=GREEN)
    middle = 0.5 * (_YAW + bearing)
    name = "$a_0$" if _is_ring(robot) else "$b_0$"
    annotate(axes, (0.36 * size * cos(middle), 0.36 * size * sin(middle)), name, colour=GREEN)
    length = hypot(last[0], last[1])
    text = f"{'R = ' if _is_ring(robot) else ''}{length:.4g} m"
    dimension(axes, (0.0, 0.0), (last[0], last[1]), text, offset=0.07 * size)
    axes.plot([0.0, first[0]], [0.0, first[1]], color=GREEN, lw=0.9, ls=DOTTED, zorder=3)
    axes.set_title(f"Robot '{robot.name}' from above, to scale")
    axes.set(xlim=(-1.85 * size, 1.5 * size), ylim=(-1.62 * size, 1.3 * size))
    axes.text(
        0.0, -1.6 * size, _facts(robot), ha="center", va="bottom", fontsize=7, parse_math=True
    )


def _facts(robot: Robot) -> str:
    first = f"wheel radius r = {robot.wheel.radius:.4g} m,  body radius {robot.body_radius:.4g} m"
    bearings = ", ".join(f"{degrees(mount.axle_angle):g}" for mount in robot.mounts)
    if _is_ring(robot):
        return f"{first}\nbearings $a_i$ = {bearings} degrees,  {robot.mass:g} kg"
    rollers = ", ".join(f"{degrees(mount.roller_angle):g}" for mount in robot.mounts)
    return f"{first},  {robot.mass:g} kg\naxles at {bearings}, rollers at {rollers} degrees"


def _is_ring(robot: Robot) -> bool:
    """Return whether all wheels are omni wheels at one distance, with axles through the centre."""
    return all(
        not mount.is_mecanum
        and isclose(mount.x, robot.mean_wheel_distance * cos(mount.axle_angle), abs_tol=1e-9)
        and isclose(mount.y, robot.mean_wheel_distance * sin(mount.axle_angle), abs_tol=1e-9)
        for mount in robot.mounts
    )


def _drive(axes: Axes, robot: Robot, pose: Pose, k: int, mount: Mount) -> None:
    """Draw the number of a wheel and its direction of forward rolling."""
    size, turn = robot.body_radius, mount.axle_angle + 0.5 * pi
    bearing = atan2(mount.y, mount.x)
    c, s = cos(bearing), sin(bearing)
    rim = 1.15 * robot.wheel.radius
    start = (mount.x + rim * cos(turn), mount.y + rim * sin(turn))
    end = (start[0] + 0.33 * size * cos(turn), start[1] + 0.33 * size * sin(turn))
    tail, tip, name, speed = transform_points(
        pose,
        [start, end, (1.13 * size * c, 1.13 * size * s),
         (end[0] + 0.1 * size * cos(turn), end[1] + 0.1 * size * sin(turn))],
    ).tolist()  # fmt: skip
    arrow(axes, tuple(tail), tuple(tip), colour=RED)
    annotate(axes, tuple(name), str(k), size=9)
    annotate(axes, tuple(speed), rf"$v_{k}$", colour=RED)


def _wheel(axes: Axes, robot: Robot) -> None:
    """Draw the hub velocity of the first wheel and its component along the driving direction."""
    hide_axes(axes)
    mount = robot.mounts[0]
    bearing, turn = mount.axle_angle, mount.axle_angle + 0.5 * pi
    hub = Pose(0.0, 0.0, turn)
    corners = transform_points(hub, [(0.34, 0.13), (-0.34, 0.13), (-0.34, -0.13), (0.34, -0.13)])
    axes.add_patch(Polygon(corners, facecolor="#e9edf2", edgecolor=DARK, lw=1.0, zorder=2))
    # rollers at the floor: across an omni wheel, inclined on a mecanum wheel
    lean = 0.1 / tan(mount.roller_angle) if mount.is_mecanum else 0.0
    rollers = [
        transform_points(hub, [(x - lean, 0.1), (x + lean, -0.1)])
        for x in (-0.24, -0.12, 0.0, 0.12, 0.24)
    ]
    for ends in rollers:
        axes.plot(ends[:, 0], ends[:, 1], color=MUTED, lw=2.2, zorder=3)
    push = Pose(0.0, 0.0, turn - mount.roller_angle)
    line, axle = (
        transform_points(push, [(-1.5, 0.0), (1.5, 0.0)]),
        transform_points(push, [(0.0, -0.75), (0.0, 1.35)]),
    )
    axes.plot(line[:, 0], line[:, 1], color=RED, lw=0.7, ls=DOTTED, zorder=1)
    axes.plot(axle[:, 0], axle[:, 1], color=GREEN, lw=0.7, ls=DOTTED, zorder=1)
    label = "axle, through the centre;\nthe rollers roll freely along it"
    if not _is_ring(robot):
        label = "the rollers roll freely\nalong this line"
    annotate(axes, (axle[1][0], axle[1][1] - 0.13), label, colour=GREEN, size=8)
    _components(axes, bearing - mount.roller_angle)
    axes.set_title("Velocity at wheel $i$", parse_math=True)
    axes.set(xlim=(-1.5, 1.5), ylim=(-1.75, 1.45))
    law = r"$v_i = r\,\omega_i = -\sin(a_i)\,\dot{x} + \cos(a_i)\,\dot{y} + R\,\dot{\theta}$"
    if not _is_ring(robot):
        law = (
            r"$v_i = r\,\omega_i\cos\rho_i = -\sin(a_i-\rho_i)\,(\dot{x} - y_i\dot{\theta})"
            r" + \cos(a_i-\rho_i)\,(\dot{y} + x_i\dot{\theta})$"
        )
    size = 9.0 if _is_ring(robot) else 6.5
    axes.text(0.0, -1.72, law, ha="center", va="bottom", fontsize=size, parse_math=True)


def _components(axes: Axes, bearing: float) -> None:
    """Draw the body velocity, its projections on the driving direction, and the wheel velocity."""
    along = (-sin(bearing), cos(bearing))
    parts = (
        ((0.95, 0.0), r"$\dot{x}$", BLUE, (0.12, 0.0)),
        ((0.0, 0.95), r"$\dot{y}$", PURPLE, (0.13, 0.0)),
    )
    for (x, y), name, colour, (dx, dy) in parts:
        arrow(axes, (0.0, 0.0), (x, y), colour=colour)
        annotate(axes, (x + dx, y + dy), name, colour=colour)
        share = x * along[0] + y * along[1]
        foot = (share * along[0], share * along[1])
        axes.plot([x, foot[0]], [y, foot[1]], color=colour, lw=0.8, ls=DOTTED, zorder=4)
    end = (1.55 * along[0], 1.55 * along[1])
    arrow(axes, (0.0, 0.0), end, colour=RED)
    annotate(axes, (end[0] - 0.06, end[1] + 0.14), "$v_i$", colour=RED)
    corner = Rectangle((0.0, 0.0), 0.1, 0.1, angle=degrees(bearing), fill=False, lw=0.7, ec=MUTED)
    axes.add_patch(corner)
