"""Figure of a robot: chassis, wheel matrix, largest speeds and accelerations, dead wheels."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin
from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from omnidrive.evaluation.figures.primitives import (
    annotate,
    arrow,
    body_patch,
    frame,
    transform_points,
)
from omnidrive.evaluation.figures.style import (
    BLUE,
    DARK,
    DASHED,
    GREEN,
    MUTED,
    PURPLE,
    RED,
    figure_style,
    hide_axes,
    new_figure,
)
from omnidrive.evaluation.tables.robot_summary import Capability, RobotSummary, support_polygon
from omnidrive.geometry import Pose
from omnidrive.robot import Mount, Robot

_ANGLES = np.linspace(0.0, 2.0 * pi, 721)
_SHARES = (0.0, 0.5, 0.8)
"""Yaw rates and yaw accelerations of the drawn slices, as fractions of the largest one."""


def robot_card(summary: RobotSummary) -> Figure:
    """Return the figure of a robot."""
    with figure_style():
        rows = max(len(summary.robot.mounts) + 2, 5)
        warnings = _warnings(summary)
        lines = warnings.count("\n") + 1 if warnings else 0
        figure = new_figure(11.0, 5.9 + 0.2 * rows + 0.18 * lines)
        grid = figure.add_gridspec(2, 1, height_ratios=(1.0, 0.085 * rows))
        upper = grid[0].subgridspec(1, 3, width_ratios=(1.15, 1, 1))
        lower = grid[1].subgridspec(1, 2)
        above, speed, acceleration = (figure.add_subplot(upper[0, k]) for k in range(3))
        matrix, facts = (figure.add_subplot(lower[0, k]) for k in range(2))
        _chassis(above, summary.robot)
        _polytope(speed, summary.speed, "Largest speeds, m/s", "rad/s", "yaw rate")
        _polytope(
            acceleration,
            summary.acceleration,
            "Largest accelerations, m/s²",
            "rad/s²",
            "yaw acceleration",
        )
        _dead_wheels(acceleration, summary)
        _legend(acceleration)
        _legend(speed)
        _matrix(matrix, summary)
        _facts(facts, summary)
        figure.supxlabel(warnings, x=0.01, ha="left", fontsize=8.5, color=RED)
    return figure


def _chassis(axes: Axes, robot: Robot) -> None:
    """Draw the robot from above: wheels, rolling directions, rollers, support polygon and COM."""
    size, pose = robot.body_radius, Pose(0.0, 0.0, 0.5 * pi)
    hide_axes(axes)
    body = body_patch(robot, pose, facecolor="#f3f5f8", edgecolor=DARK, lw=1.1, zorder=1)
    axes.add_patch(body)
    hull = support_polygon(robot)
    axes.add_patch(
        Polygon(transform_points(pose, hull), facecolor="none", edgecolor=MUTED, lw=0.8,
                ls=DASHED, zorder=2)
    )  # fmt: skip
    frame(axes, pose, 0.42 * size, ("x", "y"), BLUE)
    com = transform_points(pose, [robot.com])[0]
    axes.plot(*com, marker="o", ms=7, mfc="white", mec=DARK, zorder=7)
    axes.plot(*com, marker="+", ms=7, mec=DARK, zorder=8)
    for i, mount in enumerate(robot.mounts):
        _wheel(axes, robot, pose, i, mount)
    handles = [
        Line2D([], [], color=RED, marker=">", ms=5, label="rolling at positive speed"),
        Line2D([], [], color=GREEN, lw=2.6, label="axis of the roller on the floor: its force"),
        Line2D([], [], color=DARK, marker="o", mfc="white", lw=0, label="centre of mass"),
        Line2D([], [], color=MUTED, ls=DASHED, lw=0.8, label="support polygon"),
    ]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), fontsize=7.5)
    axes.set_title(f"Robot '{robot.name}' from above, x upwards")
    axes.set(xlim=(-1.28 * size, 1.28 * size), ylim=(-1.28 * size, 1.28 * size))


def _wheel(axes: Axes, robot: Robot, pose: Pose, i: int, mount: Mount) -> None:
    """Draw one wheel, its number, its rolling direction and the axis of its roller."""
    size, r = robot.body_radius, robot.wheel.radius
    half = max(0.5 * robot.wheel.row_gap + 0.25 * r, 0.35 * r)  # half the drawn width
    rolling = mount.axle_angle + 0.5 * pi
    ahead, aside = (cos(rolling), sin(rolling)), (cos(mount.axle_angle), sin(mount.axle_angle))

    def point(along: float, across: float) -> tuple[float, float]:
        """Return the point at distances along and across the rolling direction, in B."""
        return (
            mount.x + along * ahead[0] + across * aside[0],
            mount.y + along * ahead[1] + across * aside[1],
        )

    corners = [point(r, half), point(-r, half), point(-r, -half), point(r, -half)]
    tyre = Polygon(
        transform_points(pose, corners), facecolor="#c9ced6", edgecolor=DARK, lw=0.9, zorder=3
    )
    axes.add_patch(tyre)
    px, py = mount.drive_direction  # along the axis of the roller on the floor
    reach = max(1.2 * r, 0.1 * size)
    ends = transform_points(
        pose, [(mount.x + k * reach * px, mount.y + k * reach * py) for k in (-1.0, 1.0)]
    )
    axes.plot(*ends.T, color=GREEN, lw=2.6, solid_capstyle="butt", zorder=5)
    tail, tip = transform_points(pose, [point(1.25 * r, 0.0), point(1.25 * r + 0.26 * size, 0.0)])
    arrow(axes, tuple(tail.tolist()), tuple(tip.tolist()), colour=RED, width=1.6)
    distance = hypot(mount.x, mount.y)
    bearing = atan2(mount.y, mount.x)
    out = max(size, distance + half) + 0.16 * size
    label = transform_points(pose, [(out * cos(bearing), out * sin(bearing))])[0]
    annotate(axes, tuple(label.tolist()), str(i), size=11)


def _polytope(axes: Axes, capability: Capability, title: str, unit: str, yaw: str) -> None:
    """Draw slices of a polytope, x upwards, at several yaw rates or yaw accelerations (``yaw``)."""
    reach = 0.0
    for share, alpha in zip(_SHARES, (0.10, 0.16, 0.24), strict=True):
        level = share * capability.yaw
        values = capability.along(_ANGLES, level)
        x, y = values * np.cos(_ANGLES), values * np.sin(_ANGLES)
        reach = max(reach, 1.12 * float(values.max()))
        axes.fill(-y, x, color=BLUE, alpha=alpha, lw=0, zorder=2)
        axes.plot(
            -y, x, color=BLUE, lw=1.5 - 0.5 * share, ls="-" if share == 0.0 else (0, (4, 2)),
            label=f"{yaw} {level:.3g} {unit}", zorder=3,
        )  # fmt: skip
    axes.set_title(title)
    axes.set_aspect("equal")
    axes.set(
        xlim=(-reach, reach), ylim=(-reach, reach), xlabel="y, to the left", ylabel="x, forward"
    )
    axes.xaxis.set_major_formatter(
        lambda value, _: f"{0.0 - value:g}".replace("-", "\N{MINUS SIGN}")
    )
    axes.plot(0.0, 0.0, "+", color=DARK, ms=6, zorder=5)


def _dead_wheels(axes: Axes, summary: RobotSummary) -> None:
    """Draw the slice without yaw acceleration that remains when each wheel is dead.

    Equal slices are drawn once. Of more than four different ones only the weakest is drawn: that
    with the least acceleration in any direction.
    """
    colours = (RED, PURPLE, GREEN, "#8c564b")
    drawn: list[tuple[np.ndarray, list[int]]] = []
    for i, remaining in enumerate(summary.without):
        if remaining is None:
            continue
        values = remaining.along(_ANGLES)
        same = next((w for v, w in drawn if np.allclose(v, values, rtol=1e-6)), None)
        if same is None:
            drawn.append((values, [i]))
        else:
            same.append(i)
    if len(drawn) > len(colours):
        drawn = [min(drawn, key=lambda each: float(each[0].min()))]
    for k, (values, wheels) in enumerate(drawn):
        names = ", ".join(map(str, wheels))
        axes.plot(
            -values * np.sin(_ANGLES), values * np.cos(_ANGLES), color=colours[k], lw=1.1,
            label=f"without wheel {names}" if len(wheels) == 1 else f"without one of {names}",
            zorder=4,
        )  # fmt: skip


def _legend(axes: Axes) -> None:
    columns = 1 + (len(axes.get_legend_handles_labels()[1]) > len(_SHARES))
    axes.legend(loc="upper center", bbox_to_anchor=(0.45, -0.14), fontsize=7.5, ncols=columns)


def _matrix(axes: Axes, summary: RobotSummary) -> None:
    """Write the wheel matrix, its condition number and the loads of the wheels."""
    robot = summary.robot
    axes.axis("off")
    axes.set_title(f"Wheel matrix: rank 3, condition number {summary.condition:.3g} (1 is best)")
    cells = [
        [str(i), *(f"{_clean(value):.4g}" for value in row), f"{round(load, 6):.4g}"]
        for i, (row, load) in enumerate(zip(robot.chassis.jacobian, robot.loads, strict=True))
    ]
    heads = ["wheel", "vx, rad/m", "vy, rad/m", "yaw rate, rad/rad", "load, N"]
    _table(axes, heads, cells, (0.12, 0.21, 0.21, 0.27, 0.19))


def _clean(value: float) -> float:
    """Return 0 instead of a rounding error."""
    return 0.0 if abs(value) < 1e-9 else float(value)


def _facts(axes: Axes, summary: RobotSummary) -> None:
    """Write the largest accelerations with all wheels and without each wheel."""
    axes.axis("off")
    title = "Largest acceleration with all wheels, and with one dead wheel"
    if None in summary.without:
        title += " (0: not omnidirectional)"
    axes.set_title(title)
    rows = [["all", *_range(summary.acceleration)]]
    for i, remaining in enumerate(summary.without):
        rows.append([f"without {i}", *(_range(remaining) if remaining else ("0", "-", "-"))])
    heads = ["wheels", "weakest, m/s²", "strongest, m/s²", "yaw, rad/s²"]
    _table(axes, heads, rows, (0.22, 0.26, 0.27, 0.25))


def _warnings(summary: RobotSummary) -> str:
    lines = [line for each in summary.warnings for line in wrap(f"Warning: {each}", 150)]
    return "\n".join(lines).replace("m/s^2", "m/s²")


def _range(capability: Capability) -> tuple[str, str, str]:
    """Return the least and the greatest value of all directions, and the greatest in yaw."""
    low, high = capability.extremes
    return f"{low:.3g}", f"{high:.3g}", f"{capability.yaw:.3g}"


def _table(axes: Axes, heads: list[str], rows: list[list[str]], widths: tuple[float, ...]) -> None:
    table = axes.table(
        cellText=rows, colLabels=heads, colWidths=list(widths), cellLoc="right", loc="upper center"
    )
    table.auto_set_font_size(False)
    table.set_fontsize(8)
    for (row, _), cell in table.get_celld().items():
        cell.set_edgecolor("#d9d9d9")
        cell.set_linewidth(0.6)
        cell.set_height(0.98 / max(len(rows) + 1, 5))
        if row == 0:
            cell.set_text_props(weight="bold")
