"""Factories of the links of this package, which ``omnidrive drive --link`` names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from omnidrive.deploy.links.lekiwi import LeKiwiLink
from omnidrive.deploy.links.replay import ReplayLink
from omnidrive.deploy.links.simulated import SimulatedProcess
from omnidrive.deploy.links.wheels import WheelsLink
from omnidrive.deploy.robot_link import RobotLink
from omnidrive.deploy.scenario_robot import ScenarioRobot
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.parameter import Bounds
from omnidrive.robot import Robot
from omnidrive.scenario.planned_scenario import PlannedScenario

_DELAY = Bounds(0.0, 10.0, "s")
_INSTANT = 1e-6  # s
_PORT = Bounds(1, 2**16 - 1)


@dataclass(frozen=True, eq=False)
class LinkContext:
    """Context of a link, an argument of its factory.

    Attributes:
        planned: The planned scenario: what a simulated robot needs.
        start: Pose of the robot at the start, in W; m, m, rad.
    """

    planned: PlannedScenario
    start: Pose

    @property
    def robot(self) -> Robot:
        """Model of the robot."""
        return self.planned.robot

    @property
    def sample_time(self) -> float:
        """Time between samples of the loop, s."""
        return self.planned.scenario.sample_time


@dataclass(frozen=True)
class SimulatedParameters:
    """Delays and noise of a simulated robot."""

    latency: Annotated[float, _DELAY] = 0.0
    """Delay of readings and of commands, each."""
    jitter: Annotated[float, _DELAY] = 0.0
    """Largest random delay in addition, uniform."""
    noise: bool = False
    """Whether the measured poses have the noise of the paper."""


@dataclass(frozen=True)
class WheelsParameters:
    """Address of a motor board."""

    address: str
    """`udp://HOST:PORT`, or a serial port such as `/dev/ttyACM0@115200`."""


@dataclass(frozen=True)
class LeKiwiParameters:
    """Address of the host program on a LeKiwi."""

    host: str
    """Name or address of the computer on the robot."""
    command_port: Annotated[int, _PORT] = 5555
    """TCP port of commands."""
    observation_port: Annotated[int, _PORT] = 5556
    """TCP port of observations."""


@dataclass(frozen=True)
class ReplayParameters:
    """The log that takes the place of a robot."""

    file: str
    """Log of a drive (.mcap)."""


def simulated(context: LinkContext, parameters: SimulatedParameters) -> RobotLink:
    """Simulated robot in a process of its own, with the plant of the scenario."""
    planned = context.planned
    return SimulatedProcess(
        planned.plant_robot,
        ScenarioRobot(planned, parameters.noise),
        context.start,
        context.sample_time,
        parameters.latency,
        parameters.jitter,
        planned.scenario.seed,
    )


def wheels(context: LinkContext, parameters: WheelsParameters) -> RobotLink:
    """Motor board over UDP or a serial line, with the protocol of docs/wheel-protocol.md."""
    return WheelsLink(context.robot, parameters.address)


def lekiwi(context: LinkContext, parameters: LeKiwiParameters) -> RobotLink:
    """LeKiwi, through the host program of LeRobot."""
    return LeKiwiLink(
        context.robot, parameters.host, parameters.command_port, parameters.observation_port
    )


def replay(context: LinkContext, parameters: ReplayParameters) -> RobotLink:
    """Log instead of a robot: its readings arrive as they did, and commands are compared."""
    made = ReplayLink(parameters.file)
    if abs(made.dt - context.sample_time) > _INSTANT:
        raise InvalidInput(
            f"the log has a sample every {made.dt:g} s, the scenario every "
            f"{context.sample_time:g} s; give the scenario of the log"
        )
    return made
