"""Mounts of wheels, from their axles and rollers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidRobot
from omnidrive.robot.imports.draft import mecanum_roller, roller_angle
from omnidrive.robot.mount import Mount

Vector = Float[Array, " 3"]

_PARALLEL = 0.1  # rad
_SAME_ANGLE = 0.1  # rad; largest spread of the angles of the rollers of a wheel
_ALONG_AXLE = 0.98  # cosine between the axle and the axis of a hinge that is no roller
_ASIDE = 0.1  # least offset of a mecanum wheel from the axes of the robot, over the largest
_NO_ANGLE = 1e-5  # rad; rounding of written axes and quaternions
_MECANUM = re.compile(r"me[ck]h?an+um|swedish|omni|planar_?move", re.IGNORECASE)
_STEERED = re.compile(
    r"skid|diff(erential)?[ _-]?(drive|base|robot)|differential|ackerman|tricycle", re.IGNORECASE
)
_STATE = "--mecanum (mecanum=True) states that they are mecanum wheels with rollers at 45 degrees"


@dataclass(frozen=True, eq=False, slots=True)
class Axle:
    """Axis of a wheel with those of its rollers, in the frame of the base.

    Attributes:
        name: Name of the wheel's joint.
        axis: Unit vector.
        point: Centre of the wheel, m.
        rollers: Unit vectors and points of the rollers' axes.
    """

    name: str
    axis: Vector
    point: Vector
    rollers: tuple[tuple[Vector, Vector], ...] = ()

    @property
    def angle(self) -> float:
        """Bearing of :attr:`Mount.axle_angle`, rad.

        A wheel that turns about the horizontal axis a rolls along (a_y, -a_x) on the floor, which
        is (-sin axle_angle, cos axle_angle).
        """
        return atan2(-self.axis[1], -self.axis[0])


@dataclass(frozen=True, slots=True)
class Mounting:
    """Mounts of all wheels, and how their roller angles are known.

    Attributes:
        mounts: The mounts.
        fact: How the roller angles are known.
        is_read: Whether the description or the user states them.
        warning: What may be wrong; empty: nothing.
    """

    mounts: tuple[Mount, ...]
    fact: str
    is_read: bool
    warning: str = ""


def is_roller(axis: Vector, axle: Vector) -> bool:
    """Return whether a hinge on a wheel may be a roller, as its axis is not that of the wheel."""
    return abs(float(axis @ axle)) < _ALONG_AXLE


def mount_wheels(axles: Sequence[Axle], words: str, *, mecanum: bool) -> Mounting:
    """Return the mounts of wheels.

    Args:
        axles: Axles of the wheels.
        words: Names in the description, from which mecanum wheels without rollers are concluded.
        mecanum: Whether the user states that they are mecanum wheels.

    Raises:
        InvalidRobot: The wheels do not agree, or are those of a robot with parallel plain wheels.
    """
    bare = [axle.name for axle in axles if not axle.rollers]
    if bare and len(bare) < len(axles):
        raise InvalidRobot(f"only some wheels have rollers; without: {listed(bare)}")
    if not bare:
        tilts = [_roller_tilt(axle) for axle in axles]
        return Mounting(_mounts(axles, tilts), "roller angles, from the axes of the rollers", True)
    if all(abs(sin(axle.angle - axles[0].angle)) < _PARALLEL for axle in axles):
        return _parallel(axles, words, mecanum)
    if mecanum:
        raise InvalidRobot("the axles are not parallel; those of mecanum wheels are")
    return Mounting(
        _mounts(axles, [0.0 for _ in axles]),
        "omni wheels with rollers along the axle's normal (the axles are not parallel)",
        False,
    )


def _parallel(axles: Sequence[Axle], words: str, mecanum: bool) -> Mounting:
    """Return the mounts of mecanum wheels in the usual diamond."""
    offsets = _offsets(axles)
    text = (
        "mecanum wheels with rollers at 45 degrees{}; seen from above, the axes of the rollers on "
        "the floor form a diamond"
    )
    corners = {(ahead > 0.0, left > 0.0) for ahead, left in offsets}
    least = _ASIDE * max(hypot(*offset) for offset in offsets)
    beside = [a.name for a, o in zip(axles, offsets, strict=True) if min(map(abs, o)) < least]
    if len(axles) > 2 and beside:
        raise InvalidRobot(
            "the axles are parallel and there are no rollers, but these wheels are not at the "
            f"corners of a rectangle, as mecanum wheels are: {listed(beside)}; parallel wheels "
            "without rollers cannot push sideways"
        )
    found, plain = _MECANUM.search(words), _STEERED.search(words)
    if not mecanum and len(axles) > 2:
        fact = f"{len(axles)} wheels have parallel axles and no rollers"
        if plain and not found:
            raise InvalidRobot(
                f"{fact}, and the file contains '{one_word(plain)}': such a robot cannot move "
                f"sideways; {_STATE}"
            )
        if len(axles) != 4 or len(corners) != 4:
            raise InvalidRobot(f"{fact}; {_STATE}")
    axle = axles[0].angle
    tilts = [
        mecanum_roller(*offset, each.angle - axle - 0.5 * pi)
        for each, offset in zip(axles, offsets, strict=True)
    ]
    mounts = _mounts(axles, tilts)
    if mecanum:
        return Mounting(mounts, text.format(", as stated"), True)
    if found:
        why = f" (the axles are parallel, and the file contains '{one_word(found)}')"
        return Mounting(mounts, text.format(why), False)
    warning = (
        "mecanum wheels are a guess: the axles are parallel, but neither rollers nor names say so; "
        f"skid-steered robots look the same and cannot move sideways; {_STATE}"
    )
    return Mounting(mounts, text.format(" (the axles are parallel)"), False, warning)


def _offsets(axles: Sequence[Axle]) -> list[tuple[float, float]]:
    """Return the positions of wheels along the first one's rolling direction and to the left, m."""
    turn = axles[0].angle + 0.5 * pi
    c, s = cos(turn), sin(turn)
    points = [axle.point[:2] for axle in axles]
    centre = 0.5 * (np.min(points, axis=0) + np.max(points, axis=0))
    return [
        (float(c * x + s * y), float(c * y - s * x))
        for x, y in (point - centre for point in points)
    ]


def _mounts(axles: Sequence[Axle], tilts: Sequence[float]) -> tuple[Mount, ...]:
    return tuple(
        Mount(tidy(a.point[0]), tidy(a.point[1]), tidy(a.angle), tidy(tilt))
        for a, tilt in zip(axles, tilts, strict=True)
    )


def _roller_tilt(axle: Axle) -> float:
    """Return the angle from the rolling direction to the axes of the rollers on the floor, rad.

    Each roller is turned about the axle to the bottom of the wheel, so that the angle of the wheel
    does not matter; the result is the mean of all rollers.
    """
    down = np.array([0.0, 0.0, -1.0])
    down -= (down @ axle.axis) * axle.axis
    down /= np.linalg.norm(down)
    ahead = np.cross(axle.axis, down)
    total = 0j
    for axis, point in axle.rollers:
        radial = _middle(axis, point, axle) - axle.point
        radial -= (radial @ axle.axis) * axle.axis
        if not np.linalg.norm(radial) > 0.0:
            raise InvalidRobot(f"the axis of a roller of the wheel {axle.name[:60]} meets the axle")
        c, s = float(radial @ down), float(radial @ ahead)
        x, y = float(axis @ down), float(axis @ ahead)
        tangential = (c * y - s * x) / hypot(c, s)
        turned = tangential * ahead + (axis @ axle.axis) * axle.axis
        tilt = roller_angle(atan2(turned[1], turned[0]), axle.angle)
        total += complex(cos(2.0 * tilt), sin(2.0 * tilt))
    if abs(total) < cos(2.0 * _SAME_ANGLE) * len(axle.rollers):
        raise InvalidRobot(
            f"the rollers of the wheel {axle.name[:60]} are inclined by different angles"
        )
    mean = 0.5 * atan2(total.imag, total.real)
    return mean if abs(mean) > _NO_ANGLE else 0.0


def _middle(axis: Vector, point: Vector, axle: Axle) -> Vector:
    """Return the point of a roller's axis that is closest to the axle, the roller's middle."""
    normal = axis - (axis @ axle.axis) * axle.axis
    offset = point - axle.point
    return point - float(offset @ normal) / float(normal @ normal) * axis


def one_word(match: re.Match[str]) -> str:
    """Return what a pattern has matched, in lower case."""
    return match.group().lower()


def listed(names: Sequence[str], most: int = 12) -> str:
    """Return names of a description as a list of bounded length."""
    return ", ".join(name[:60] for name in names[:most]) + (", ..." if len(names) > most else "")


def tidy(value: float) -> float:
    """Return a number without rounding errors of a rotation."""
    return round(float(value), 12) + 0.0  # no negative zero
