"""Capabilities of a robot: largest speeds and accelerations, dead wheels, warnings."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, pi, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.reduced_drive import ReducedDrive
from omnidrive.errors import InvalidGeometry
from omnidrive.robot import GRAVITY, Robot

_DIRECTIONS = 720
_MAX_CONDITION = 3.0
_MAX_COUPLING = 0.05
_MIN_EFFECTIVE_RADIUS = 0.4  # over the mean distance of the wheels
_MIN_MARGIN = 0.2  # distance to the edge of the support polygon, over the wheels' distance
_MIN_LOAD_SHARE = 0.4  # load of a wheel over the mean load


@dataclass(frozen=True, eq=False, slots=True)
class Capability:
    """Polytope ``|faces @ (x, y, yaw)| <= 1`` of body twists or accelerations, in B.

    Attributes:
        faces: One row per pair of faces; s/m, s/m, s/rad or s^2/m, s^2/m, s^2/rad.
    """

    faces: Float[Array, "faces 3"]

    def along(self, angles: Float[Array, " angles"], yaw: float = 0.0) -> Float[Array, " angles"]:
        """Return the largest values along bearings in B at a given value of yaw.

        Args:
            angles: Bearings, rad.
            yaw: Yaw rate or yaw acceleration; rad/s or rad/s^2.

        Returns:
            Speed or acceleration, m/s or m/s^2; 0 where ``yaw`` alone exceeds a face.
        """
        slopes = self.faces[:, :2] @ np.array([np.cos(angles), np.sin(angles)])
        used = self.faces[:, 2:] * yaw
        if np.abs(used).max() >= 1.0:
            return np.zeros_like(angles)
        with np.errstate(divide="ignore"):
            minimum: Float[Array, " angles"] = (
                (1.0 - np.sign(slopes) * used) / np.abs(slopes)
            ).min(axis=0)
        return minimum

    @property
    def yaw(self) -> float:
        """Largest yaw rate or yaw acceleration without translation; rad/s or rad/s^2."""
        return float(1.0 / np.abs(self.faces[:, 2]).max())

    @property
    def extremes(self) -> tuple[float, float]:
        """Least and greatest of the largest values over all bearings; m/s or m/s^2."""
        values = self.along(np.linspace(0.0, 2.0 * pi, _DIRECTIONS, endpoint=False))
        return float(values.min()), float(values.max())


@dataclass(frozen=True, eq=False, slots=True)
class RobotSummary:
    """Capabilities of a robot at rest on a level floor.

    Attributes:
        robot: The robot.
        condition: Condition number of the rim Jacobian with yaw scaled by the effective radius; 1
            if the wheels drive equally well in every direction and in rotation.
        speed: Body twists within the wheel-speed limits.
        acceleration: Accelerations within the force limits of all wheels.
        without: Accelerations without each wheel; None: the others cannot produce every twist.
        tipping: Acceleration at which the robot tips over the nearest edge, m/s^2.
        warnings: One sentence per questionable property.
    """

    robot: Robot
    condition: float
    speed: Capability
    acceleration: Capability
    without: tuple[Capability | None, ...]
    tipping: float
    warnings: tuple[str, ...]

    @classmethod
    def of(cls, robot: Robot) -> RobotSummary:
        """Compute the summary of a robot."""
        scaled = robot.rim_jacobian / [1.0, 1.0, robot.effective_radius]
        speed = Capability(robot.chassis.jacobian / robot.max_wheel_speed)
        acceleration = Capability(robot.acceleration_faces)
        condition = float(np.linalg.cond(scaled))
        margin = support_margin(robot)
        tipping = GRAVITY * margin / robot.com_height
        warnings = [
            *_kinematic_warnings(robot, scaled, condition),
            *_load_warnings(robot, margin, tipping, acceleration.extremes[1]),
        ]
        without = tuple(_without(robot, i) for i in range(len(robot.mounts)))
        return cls(robot, condition, speed, acceleration, without, tipping, tuple(warnings))


def support_polygon(robot: Robot) -> list[tuple[float, float]]:
    """Return the corners of the convex hull of the wheels' centres, counter-clockwise; B, m.

    Andrew, "Another efficient algorithm for convex hulls in two dimensions", Inf. Process. Lett. 9,
    1979.
    """
    points = sorted({(m.x, m.y) for m in robot.mounts})
    corners = []
    for ordered in (points, points[::-1]):
        chain: list[tuple[float, float]] = []
        for point in ordered:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        corners += chain[:-1]
    return corners


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return twice the area of the triangle a, b, c; positive if it turns to the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def support_margin(robot: Robot) -> float:
    """Return the distance of the centre of mass to the edge of the support polygon, m."""
    corners = support_polygon(robot)
    margins = [
        _turn(start, end, robot.com) / hypot(end[0] - start[0], end[1] - start[1])
        for start, end in zip(corners, [*corners[1:], corners[0]], strict=True)
    ]
    return max(min(margins), 0.0)


def _without(robot: Robot, wheel: int) -> Capability | None:
    try:
        return Capability(ReducedDrive.of(robot, [wheel]).acceleration_faces)
    except InvalidGeometry:
        return None


def _kinematic_warnings(
    robot: Robot, scaled: Float[Array, "wheels 3"], condition: float
) -> list[str]:
    """Return warnings about the wheel matrix and the footprint."""
    warnings = []
    if condition > _MAX_CONDITION:
        warnings.append(
            f"badly conditioned: the condition number is {condition:.3g}, so that wheel speeds "
            "determine some motion far less accurately than others; turn or move the wheels"
        )
    gram = scaled.T @ scaled
    axes = ("x", "y", "yaw")
    centred = hypot(
        sum(mount.x for mount in robot.mounts), sum(mount.y for mount in robot.mounts)
    ) < 0.01 * robot.mean_wheel_distance * len(robot.mounts)
    cause = (
        "is one of the angles of the wheels, or its sign, wrong?"
        if centred
        else "is the origin of the frame at their centre?"
    )
    for i, j in ((0, 1), (0, 2), (1, 2)):
        coupling = float(gram[i, j] / np.sqrt(gram[i, i] * gram[j, j]))
        if abs(coupling) > _MAX_COUPLING:
            warnings.append(
                f"asymmetric: the wheels couple {axes[i]} and {axes[j]} "
                f"(correlation {coupling:.2f}); {cause}"
            )
    radius, distance = robot.effective_radius, robot.mean_wheel_distance
    if radius < _MIN_EFFECTIVE_RADIUS * distance:
        key = "roller_angle" if any(m.is_mecanum for m in robot.mounts) else "axle_angle"
        warnings.append(
            f"weak rotation: the wheels turn the robot with an effective radius of {radius:.2g} m, "
            f"but are {distance:.2g} m from its centre; are the signs of {key} swapped?"
        )
    reach = max(_corner_distance(robot, i) for i in range(len(robot.mounts)))
    if reach > robot.body_radius + 1e-9:
        warnings.append(
            f"footprint: a wheel reaches {reach:.3g} m from the centre, beyond body_radius "
            f"{robot.body_radius:.3g} m, and could touch obstacles"
        )
    assumed = robot.assumed_effective_radius
    if assumed is not None and abs(assumed / robot.effective_radius - 1.0) > 1e-3:
        warnings.append(
            f"miscalibrated: the wheel controller assumes an effective radius of {assumed:.4g} m, "
            f"the wheels have {robot.effective_radius:.4g} m"
        )
    return warnings


def _corner_distance(robot: Robot, i: int) -> float:
    """Return the largest distance of a corner of wheel i from the origin of B, m."""
    mount, wheel = robot.mounts[i], robot.wheel
    c, s = cos(mount.axle_angle), sin(mount.axle_angle)
    half = 0.5 * wheel.row_gap
    return max(
        hypot(mount.x + a * half * c - b * wheel.radius * s,
              mount.y + a * half * s + b * wheel.radius * c)
        for a in (-1, 1) for b in (-1, 1)
    )  # fmt: skip


def _load_warnings(robot: Robot, margin: float, tipping: float, acceleration: float) -> list[str]:
    """Return warnings about the distribution of the weight."""
    warnings = []
    loads = robot.loads
    minimum = int(loads.argmin())
    share = float(loads[minimum] / loads.mean())
    if share < _MIN_LOAD_SHARE:
        warnings.append(
            f"unloaded: wheel {minimum} carries {loads[minimum]:.3g} N, {100 * share:.0f} % of the "
            "mean load, and slips first"
        )
    if margin < _MIN_MARGIN * robot.mean_wheel_distance:
        warnings.append(
            f"centre of mass: it is {margin:.2g} m from the edge of the support polygon"
        )
    if tipping < acceleration:
        warnings.append(
            f"tipping: the robot tips at {tipping:.3g} m/s^2, below the {acceleration:.3g} m/s^2 "
            "that its wheels reach; lower the centre of mass or the limits of the motion"
        )
    return warnings
