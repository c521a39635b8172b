"""Tables of a robot and its capabilities for the terminal."""

from __future__ import annotations

from math import degrees, pi, radians
from typing import Any

import numpy as np

from omnidrive.evaluation import Table
from omnidrive.evaluation.tables.robot_summary import Capability, RobotSummary
from omnidrive.geometry.polygon import Polygon
from omnidrive.robot import Robot

_BEARINGS = (0, 45, 90, 135)  # degrees; the polytopes are symmetric about their origin


def robot_tables(summary: RobotSummary) -> list[Table]:
    """Return the tables of a robot: parameters, wheels, speeds and accelerations, dead wheels."""
    return [
        _parameters(summary),
        _wheels(summary.robot),
        _directions(summary),
        _dead_wheels(summary),
    ]


def robot_record(summary: RobotSummary) -> dict[str, Any]:
    """Return the quantities of the tables as JSON data; keys contain the units."""
    robot = summary.robot
    return {
        "name": robot.name,
        "wheels": len(robot.mounts),
        "wheel_radius_m": robot.wheel.radius,
        "mass_kg": robot.mass,
        "yaw_inertia_kg_m2": robot.yaw_inertia,
        "effective_radius_m": robot.effective_radius,
        "wheel_matrix": robot.chassis.jacobian.tolist(),
        "loads_n": robot.loads.tolist(),
        "condition": summary.condition,
        "tipping_m_per_s2": summary.tipping,
        "speed": _capability_record(summary.speed, "s"),
        "acceleration": _capability_record(summary.acceleration, "s2"),
        "acceleration_without_wheel": [
            left and _capability_record(left, "s2") for left in summary.without
        ],
        "warnings": list(summary.warnings),
    }


def _capability_record(capability: Capability, per: str) -> dict[str, float]:
    weakest, strongest = capability.extremes
    return {
        f"weakest_m_per_{per}": weakest,
        f"strongest_m_per_{per}": strongest,
        f"rotation_rad_per_{per}": capability.yaw,
    }


def _parameters(summary: RobotSummary) -> Table:
    robot = summary.robot
    x, y = robot.com
    limits = robot.force_limits
    limited_by = (
        "friction" if robot.friction_limits.max() <= limits.min() + 1e-9 else "friction or motors"
    )
    if robot.max_torque / robot.wheel.radius < robot.friction_limits.min():
        limited_by = "motors"
    rows = [
        ("wheels", f"{len(robot.mounts)}, radius {robot.wheel.radius:g} m"),
        ("mass", f"{robot.mass:g} kg, of which wheels {robot.mass - robot.frame_mass:.3g} kg"),
        ("yaw inertia", f"{robot.yaw_inertia:.4g} kg m^2"),
        ("centre of mass", f"({x:g}, {y:g}) m, height {robot.com_height:g} m"),
        ("body radius", f"{robot.body_radius:g} m"),
        *_outline_row(robot),
        ("effective radius", f"{robot.effective_radius:.4g} m (rim speed per yaw rate)"),
        ("motors", f"{robot.max_wheel_speed:g} rad/s, {robot.max_torque:g} N m, "
                   f"servo {robot.servo_gain:g} N m s/rad"),
        ("force per wheel", f"{limits.min():.4g} to {limits.max():.4g} N, limited by {limited_by}"),
        ("lag", f"translation {1e3 * robot.lag[0]:.3g} ms, rotation {1e3 * robot.lag[1]:.3g} ms"),
        ("rank", "3: the wheels produce every twist"),
        ("condition", f"{summary.condition:.3g} (1: equally good in every direction)"),
        ("tipping", f"at {summary.tipping:.3g} m/s^2"),
    ]  # fmt: skip
    return Table(f"Robot {robot.name}", ("quantity", "value"), tuple(rows), prose=True)


def _outline_row(robot: Robot) -> list[tuple[str, str]]:
    """Return the row of the outline, if the robot has one."""
    if robot.outline is None:
        return []
    return [("outline", str(Polygon.of(np.array(robot.outline))))]


def _wheels(robot: Robot) -> Table:
    rows = []
    for i, (m, row, load) in enumerate(
        zip(robot.mounts, robot.chassis.jacobian, robot.loads, strict=True)
    ):
        rolling = _bearing(m.axle_angle + 0.5 * pi)
        numbers = (m.x, m.y, rolling, degrees(m.roller_angle), *row)
        rows.append((str(i), *(f"{_clean(each):.4g}" for each in numbers), f"{round(load, 6):.4g}"))
    columns = ("wheel", "x m", "y m", "rolls towards deg", "roller deg",
               "vx rad/m", "vy rad/m", "yaw rate rad/rad", "load N")  # fmt: skip
    note = (
        "vx, vy, yaw rate: the wheel matrix, speed of each wheel per unit of body twist. A wheel "
        "rolls towards this bearing at positive speed; its force acts along the roller's axis, "
        "which is turned from there by minus the roller angle."
    )
    return Table("Wheels", columns, tuple(rows), note)


def _directions(summary: RobotSummary) -> Table:
    rows = []
    for bearing in _BEARINGS:
        angle = np.array([radians(bearing)])
        speed, acceleration = summary.speed.along(angle)[0], summary.acceleration.along(angle)[0]
        rows.append((f"{bearing} and {bearing + 180} deg", f"{speed:.3g} m/s",
                     f"{acceleration:.3g} m/s^2"))  # fmt: skip
    for k, name in enumerate(("weakest direction", "strongest direction")):
        rows.append(
            (name, f"{summary.speed.extremes[k]:.3g} m/s",
             f"{summary.acceleration.extremes[k]:.3g} m/s^2")
        )  # fmt: skip
    rows.append(
        ("rotation", f"{summary.speed.yaw:.3g} rad/s", f"{summary.acceleration.yaw:.3g} rad/s^2")
    )
    return Table(
        "Largest speed and acceleration",
        ("bearing from x", "speed", "acceleration"),
        tuple(rows),
        "Each alone: translation without rotation, from rest on a level floor.",
    )


def _dead_wheels(summary: RobotSummary) -> Table:
    whole = summary.acceleration
    rows = [
        (str(i), *(_left(left, whole) if left else ("no longer omnidirectional", "", "")))
        for i, left in enumerate(summary.without)
    ]
    columns = ("dead wheel", "weakest direction", "strongest direction", "rotation")
    return Table(
        "Acceleration that one dead wheel leaves", columns, tuple(rows),
        "The dead wheel rolls freely and carries its load; percentages of the intact robot.",
    )  # fmt: skip


def _left(left: Capability, whole: Capability) -> tuple[str, str, str]:
    (low, high), (all_low, all_high) = left.extremes, whole.extremes
    return (
        f"{low:.3g} m/s^2 ({100 * low / all_low:.0f} %)",
        f"{high:.3g} m/s^2 ({100 * high / all_high:.0f} %)",
        f"{left.yaw:.3g} rad/s^2 ({100 * left.yaw / whole.yaw:.0f} %)",
    )


def _bearing(angle: float) -> float:
    """Return an angle in degrees in (-180, 180], without rounding errors."""
    turned = -((180.0 - degrees(angle)) % 360.0 - 180.0)
    return _clean(round(turned, 9))


def _clean(value: float) -> float:
    """Return 0 instead of a rounding error."""
    return 0.0 if abs(value) < 1e-9 else float(value)
