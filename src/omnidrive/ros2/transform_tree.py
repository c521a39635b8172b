"""Frames of a robot by name, and the transforms between them."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.errors import one_line
from omnidrive.geometry import Pose, compose

MAX_FRAMES = 1000
"""Largest number of frames that are kept."""


class Frames(NamedTuple):
    """Names of the frames of a robot (REP 105)."""

    world: str = "map"
    """Frame W, in which references and plans are given."""
    odom: str = "odom"
    """Frame of odometry, in which the pose is continuous."""
    base: str = "base_link"
    """Frame B of the robot."""


class Transform(NamedTuple):
    """Pose of a frame in its parent."""

    parent: str
    pose: Pose
    stamp: float
    """Time in ROS, s; infinite: constant."""
    is_level: bool = True
    """Whether the frame's z axis is that of its parent, to 10 degrees."""


class TransformTree:
    """Transforms by the name of the child, bounded in number."""

    def __init__(self) -> None:
        self._parents: dict[str, Transform] = {}

    def set(self, child: str, transform: Transform) -> None:
        """Set the parent of a frame, unless there are too many frames."""
        if child in self._parents or len(self._parents) < MAX_FRAMES:
            self._parents[child] = transform

    def get(self, child: str) -> Transform | None:
        """Return the transform of a frame to its parent; None: it is not known."""
        return self._parents.get(child)

    def pose(self, frame: str, within: str) -> Pose | None:
        """Return the pose of a frame in one of its ancestors; None: it is not below it."""
        pose = Pose(0.0, 0.0, 0.0)
        for _ in range(MAX_FRAMES):
            if frame == within:
                return pose
            found = self._parents.get(frame)
            if found is None:
                return None
            pose, frame = compose(found.pose, pose), found.parent
        return None

    def is_level(self, frame: str) -> bool:
        """Return whether the z axes of a frame and all its known ancestors are parallel."""
        return all(
            found.is_level for name in self.chain(frame) if (found := self._parents.get(name))
        )

    def names(self) -> list[str]:
        """Return the names of all frames, in one line each, sorted."""
        parents = {each.parent for each in self._parents.values()}
        return sorted(one_line(each, 60) for each in parents | self._parents.keys())

    def chain(self, frame: str) -> list[str]:
        """Return the names from a frame up to its last known ancestor."""
        names = [frame]
        while (found := self._parents.get(names[-1])) is not None and found.parent not in names:
            names.append(found.parent)
        return names
