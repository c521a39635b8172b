"""The section of a scenario about the plant `coppeliasim`."""

from __future__ import annotations

from math import pi
from typing import Annotated, Literal

from pydantic import Field

from omnidrive.parameter import Bounds
from omnidrive.study.section import Section

_Path = Annotated[str, Field(pattern=r"^/[^\x00-\x1f]{1,200}$")]


class CoppeliaSimSection(Section):
    """Where CoppeliaSim listens, and what the robot is called in the scene that it has open.

    The defaults are the names in the scene of the paper's author.
    """

    host: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]{1,253}$")] = "localhost"
    port: Annotated[int, Bounds(1, 65_535, "")] = 23000
    """Of the add-on 'ZMQ remote API server'."""
    timeout: Annotated[float, Bounds(0.1, 600.0, "s")] = 10.0
    """Longest wait for one answer."""
    interface: Literal["joints", "signals"] = "joints"
    """`joints`: any scene, wheel by wheel; `signals`: the author's scene with its script."""
    model: _Path = "/omni"
    """The robot's base, which is moved to the start."""
    body: _Path | None = None
    """The object whose pose is read, its z axis up; None: the base."""
    body_yaw: Annotated[float, Bounds(-2 * pi, 2 * pi, "rad")] = 0.0
    """Bearing of the robot's x axis in the frame of that object."""
    joints: Annotated[tuple[_Path, ...], Field(min_length=3, max_length=16)] = (
        "/omni/motor3",
        "/omni/motor2",
        "/omni/motor1",
        "/omni/motor4",
    )
    """Every wheel's joint, in the order of the robot's wheels."""
    signs: Annotated[tuple[Literal[-1, 1], ...], Field(min_length=3, max_length=16)] = (
        -1,
        -1,
        -1,
        -1,
    )
    """Of every joint: 1 where it turns as the robot's wheel does, -1 where the other way round."""
