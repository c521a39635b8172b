"""Nobody watches."""

from __future__ import annotations

from omnidrive.control.controller import Command, Controller
from omnidrive.control.supervision.event import Event, Seen
from omnidrive.geometry import BodyTwist, Pose


class Unsupervised:
    """Lets everything pass where there is no :class:`Supervisor`."""

    controller: Controller | None = None
    stopped: str | None = None
    at_rest = False
    events: tuple[Event, ...] = ()

    def reset(self) -> None:
        """Nothing is remembered."""

    def feel(self, t: float, command: BodyTwist, dt: float, seen: Seen) -> None:
        """Wheels are trusted."""

    def look(self, t: float, seen: Seen, target: Pose) -> Pose:
        """The pose as it is seen."""
        return seen.pose

    def allow(self, command: Command, dt: float) -> Command:
        """The command as it is."""
        return command
