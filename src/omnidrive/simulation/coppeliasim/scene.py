"""Address of CoppeliaSim, and names of the robot's objects in its scene."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Annotated, Literal, get_args

from pydantic import Field

from omnidrive.parameter import Bounds, check_bounds, check_choice

Interface = Literal["joints", "signals"]
_ScenePath = Annotated[str, Field(pattern=r"^/[^\x00-\x1f]{1,200}$")]


@dataclass(frozen=True, slots=True)
class CoppeliaSimScene:
    """Connection to CoppeliaSim and names of the robot's objects in the open scene.

    The defaults fit the scene of the paper's author.

    Raises:
        InvalidInput: A number is out of its range, or the interface is unknown.
    """

    host: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]{1,253}$")] = "localhost"
    """Host name or address of the computer that runs CoppeliaSim."""
    port: Annotated[int, Bounds(1, 65_535, "")] = 23000
    """TCP port of the add-on 'ZMQ remote API server'."""
    timeout: Annotated[float, Bounds(0.1, 600.0, "s")] = 10.0
    """Maximum time to wait for one answer, s."""
    interface: Interface = "joints"
    """`joints`: set the velocity of every wheel joint, in any scene; `signals`: send signals to the
    script in the scene of the paper's author."""
    model: _ScenePath = "/omni"
    """Path of the base of the robot model, which is moved to the start pose."""
    body: _ScenePath | None = None
    """Path of the object whose pose is read; its z axis must point up. None: the base."""
    body_yaw: Annotated[float, Bounds(-2 * pi, 2 * pi, "rad")] = 0.0
    """Angle of the robot's x axis in the frame of the object `body`, rad."""
    joints: Annotated[tuple[_ScenePath, ...], Field(min_length=3, max_length=16)] = (
        "/omni/motor3",
        "/omni/motor2",
        "/omni/motor1",
        "/omni/motor4",
    )
    """Paths of the wheel joints, in the order of the robot's wheels."""
    signs: Annotated[tuple[Literal[-1, 1], ...], Field(min_length=3, max_length=16)] = (
        -1,
        -1,
        -1,
        -1,
    )
    """Sign of every joint: 1 if its positive direction is that of the robot's wheel, else -1."""

    def __post_init__(self) -> None:
        check_bounds(self)
        check_choice("interface to CoppeliaSim", self.interface, get_args(Interface))
