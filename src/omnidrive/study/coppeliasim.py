"""Scenario section of the plant `coppeliasim`."""

from __future__ import annotations

from math import pi
from typing import Annotated, Literal

from pydantic import Field

from omnidrive.parameter import Bounds
from omnidrive.study.section import Section

_Path = Annotated[str, Field(pattern=r"^/[^\x00-\x1f]{1,200}$")]


class CoppeliaSimSection(Section):
    """Connection to CoppeliaSim and names of the robot's objects in the open scene.

    The defaults fit the scene of the paper's author.
    """

    host: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]{1,253}$")] = "localhost"
    """Host name or address of the computer that runs CoppeliaSim."""
    port: Annotated[int, Bounds(1, 65_535, "")] = 23000
    """TCP port of the add-on 'ZMQ remote API server'."""
    timeout: Annotated[float, Bounds(0.1, 600.0, "s")] = 10.0
    """Maximum time to wait for one answer, s."""
    interface: Literal["joints", "signals"] = "joints"
    """`joints`: set the velocity of every wheel joint, in any scene; `signals`: send signals to the
    script in the scene of the paper's author."""
    model: _Path = "/omni"
    """Path of the base of the robot model, which is moved to the start pose."""
    body: _Path | None = None
    """Path of the object whose pose is read; its z axis must point up. None: the base."""
    body_yaw: Annotated[float, Bounds(-2 * pi, 2 * pi, "rad")] = 0.0
    """Angle of the robot's x axis in the frame of the object `body`, rad."""
    joints: Annotated[tuple[_Path, ...], Field(min_length=3, max_length=16)] = (
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
