"""Headings of sections of a path, each by its own rule, joined by smooth turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from typing import Literal, get_args

import numpy as np
from jaxtyping import Bool

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.parameter import check_choice
from omnidrive.planning import SplinePath
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference.headings.heading_spline import Directions, PathSamples

SectionHeading = Literal["path", "tangent", "fixed", "face"]
"""Headings of the path; direction of travel; one heading; toward a point."""

_NEAR = 1e-3
"""Distance from a target below which it has no direction, m."""
_ROUNDING = 1e-6
"""Share of its length by which a section may end beyond the path."""


@dataclass(frozen=True, slots=True)
class HeadingSection:
    """Heading along a part of a path.

    Attributes:
        start: Arc length from the start of the path at which the section starts, in m.
        end: Arc length at which it ends, in m.
        heading: Rule of the heading, see :data:`SectionHeading`.
        yaw: Heading for ``fixed``, in rad, modulo whole turns.
        target: Point (x, y) in W, in m, for ``face``.

    Raises:
        InvalidInput: The rule is unknown, or lacks what it needs or has what it does not need, or
            an arc length is negative or not finite, or the end is not beyond the start.
    """

    start: float
    end: float
    heading: SectionHeading
    yaw: float | None = None
    target: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_choice("heading", self.heading, get_args(SectionHeading))
        if not (isfinite(self.end) and 0.0 <= self.start < self.end):
            raise InvalidInput(
                "a section of headings needs 0 <= start < end in m, got "
                f"{self.start:g} and {self.end:g}"
            )
        if (self.heading == "fixed") != (self.yaw is not None):
            raise InvalidInput("a section needs a yaw for the heading 'fixed', and only for it")
        if (self.heading == "face") != (self.target is not None):
            raise InvalidInput("a section needs a target for the heading 'face', and only for it")
        if not np.isfinite([self.yaw or 0.0, *(self.target or ())]).all():
            raise InvalidInput("yaw and target of a section of headings must be finite")


def heading_in_sections(
    path: SplinePath,
    sections: Sequence[HeadingSection],
    start_yaw: float | None = None,
    goal_yaw: float | None = None,
) -> SplinePath:
    """Return the path with headings by the rules of its sections, and smooth turns between them.

    The headings are those of :func:`~omnidrive.reference.headings.least_strafing.least_strafing`
    with the directions of the sections in the place of the direction of travel: within about 0.4 m
    of a boundary at which the directions differ, and of an end with a given heading, the heading
    turns from one to the other. Between sections it turns as little as possible.

    Args:
        path: Path to follow.
        sections: Sections in the order of the path; they may leave gaps.
        start_yaw: Heading at the start, rad, modulo whole turns, met exactly; None: free.
        goal_yaw: Heading at the goal, likewise.

    Raises:
        InvalidInput: There is no section, sections overlap or are not in order, or one ends beyond
            the path or is too short to contain a sample of it.
        InvalidReference: The path passes through the target of a section.
    """
    samples = PathSamples.of(path)
    along = cumulative_length(np.vstack([path.control_points[:1, :2], samples.poses[:, :2]]))[1:]
    _check(sections, path.length)
    yaw, turns = np.zeros((2, len(along)))
    where = np.zeros(len(along), bool)
    for section in sections:
        within = (along >= section.start) & (along <= section.end)
        if not samples.lengths[within].any():
            raise InvalidInput(
                f"the section of headings from {section.start:g} to {section.end:g} m is too short"
            )
        found = _directions(samples, section, within)
        yaw[within], turns[within] = found.yaw[within], found.turns[within]
        where |= within
    return samples.nearest(Directions(yaw, turns), start_yaw, goal_yaw, where)


def _check(sections: Sequence[HeadingSection], length: float) -> None:
    """Raise InvalidInput if sections are missing, out of order, or beyond the path (m)."""
    if not sections:
        raise InvalidInput("there is no section of headings")
    for before, after in pairwise(sections):
        if after.start < before.end:
            raise InvalidInput(
                f"the section of headings from {after.start:g} m starts before the one before it "
                f"ends, at {before.end:g} m"
            )
    if sections[-1].end > length * (1.0 + _ROUNDING):
        raise InvalidInput(
            f"a section of headings ends at {sections[-1].end:g} m, and the path is {length:.6g} m "
            "long"
        )


def _directions(
    samples: PathSamples, section: HeadingSection, within: Bool[Array, " n"]
) -> Directions:
    """Return the directions of a section, which are valid at the samples within it."""
    if section.heading == "tangent":
        return samples.along_travel()
    if section.heading == "path":
        return Directions(samples.poses[:, 2], samples.first[:, 2])
    if section.target is None:
        assert section.yaw is not None
        return Directions(*np.broadcast_arrays(section.yaw, np.zeros(len(samples.poses))))
    dx, dy = (np.array(section.target) - samples.poses[:, :2]).T
    square = dx * dx + dy * dy
    if square[within].min() < _NEAR**2:
        raise InvalidReference(
            f"the path passes through the target ({section.target[0]:g}, {section.target[1]:g}) m "
            "of a section, so that the heading cannot point at it; choose another target"
        )
    turns = (dy * samples.first[:, 0] - dx * samples.first[:, 1]) / np.maximum(square, _NEAR**2)
    return Directions(np.arctan2(dy, dx), turns)
