"""Address of CoppeliaSim, and names of the robot's objects in its scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from omnidrive.parameter import check_choice

Interface = Literal["joints", "signals"]


@dataclass(frozen=True, slots=True)
class CoppeliaSimScene:
    """Settings of :class:`~omnidrive.simulation.coppeliasim.CoppeliaSimPlant`.

    The default paths are those of the scene of the paper's author.

    Attributes:
        host: Name or address of the machine.
        port: Port of its ZeroMQ remote API server.
        timeout: Longest wait for one reply, s.
        interface: ``joints``: wheels are commanded and read as joints, in any scene; ``signals``:
            by the signals that the script in the author's scene reads and writes.
        model: Path of the robot's base, which is moved to the start.
        body: Path of the object whose pose is read, with its z axis up; None: the base.
        body_yaw: Bearing of B's x axis in the frame of that object, rad.
        joints: Path of every wheel's joint, in the order of the robot's mounts.
        signs: Per joint, 1 if its positive direction is that of the mount, -1 if it is opposite.

    Raises:
        InvalidInput: The interface is unknown.
    """

    host: str = "localhost"
    port: int = 23000
    timeout: float = 10.0
    interface: Interface = "joints"
    model: str = "/omni"
    body: str | None = None
    body_yaw: float = 0.0
    joints: tuple[str, ...] = ("/omni/motor3", "/omni/motor2", "/omni/motor1", "/omni/motor4")
    signs: tuple[int, ...] = (-1, -1, -1, -1)

    def __post_init__(self) -> None:
        check_choice("interface to CoppeliaSim", self.interface, get_args(Interface))
