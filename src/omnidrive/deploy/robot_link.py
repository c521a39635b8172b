"""The interface of a connection to a robot, real or simulated."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.control import CommandValue
from omnidrive.deploy.clock import Clock
from omnidrive.errors import OmnidriveError
from omnidrive.estimation import SensorReadings
from omnidrive.robot import Robot


class LinkLost(OmnidriveError):
    """The connection to the robot failed for good."""


class LinkCapabilities(NamedTuple):
    """What a link supports."""

    watchdog: float | None = None
    """Time without a command after which the robot itself stops, s. None: it does not, so that it
    goes on if the computer or the connection fails."""
    measures_pose: bool = True
    """Whether it delivers pose fixes; otherwise the start must be given."""
    wheel_speeds: bool = False
    """Whether it takes commands of wheel speeds, as every link takes body twists."""
    wheel_torques: bool = False
    """Whether it takes commands of wheel torques."""


@runtime_checkable
class RobotLink(Protocol):
    """A connection to a robot.

    No call blocks for longer than a fraction of a sample. Stamps are times of the clock of
    :meth:`open`; a link translates those of the robot.
    """

    @property
    def capabilities(self) -> LinkCapabilities:
        """What the link supports."""
        ...

    @property
    def robot(self) -> Robot:
        """The robot, whose limits no command exceeds."""
        ...

    def open(self, clock: Clock) -> None:
        """Connect; ``clock`` gives the stamps of all readings.

        Raises:
            LinkLost: The robot cannot be reached, or another program controls it.
        """
        ...

    def read(self) -> SensorReadings | None:
        """Return the readings that arrived since the last call, the newest of each sensor.

        None: nothing arrived. Wheel angles count from any origin.

        Raises:
            LinkLost: The connection failed for good.
        """
        ...

    def send(self, value: CommandValue) -> None:
        """Send a command: a body twist (B; m/s, m/s, rad/s), or what the capabilities allow.

        Raises:
            LinkLost: The connection failed for good.
        """
        ...

    def stop(self) -> None:
        """Command zero speed; also after a failure, and more than once."""
        ...

    def close(self) -> None:
        """Stop the robot and disconnect; the link is not used afterwards."""
        ...


@runtime_checkable
class ReportingLink(Protocol):
    """A link that has something to say after a drive."""

    @property
    def report(self) -> str:
        """What the link found, in one line."""
        ...


@runtime_checkable
class ExplainingLink(Protocol):
    """A link that says what is wrong with the robot's readings."""

    @property
    def fault(self) -> str:
        """Why no usable readings arrive, in one line; empty: not known."""
        ...
