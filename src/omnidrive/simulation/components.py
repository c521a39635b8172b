"""Plants of this package as components, and the context that every plant gets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import pi
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from omnidrive import simulation  # its modules are imported on use, those of one plant only
from omnidrive.maps import OccupancyGrid
from omnidrive.parameter import Bounds
from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.plant import Plant, PlantCapabilities

_WHEELS = PlantCapabilities(wheel_speeds=True, wheel_torques=True)
_MUJOCO = _WHEELS._replace(disturbable=True, collides=True, renders=True, forces=True)
_ScenePath = Annotated[str, Field(pattern=r"^/[^\x00-\x1f]{1,200}$")]


@dataclass(frozen=True, eq=False)
class PlantContext:
    """What a plant is made for.

    Attributes:
        robot: The simulated robot.
        rng: Generator of the initial angles of the rollers. None: equal angles.
        obstacles: Map around the robot. None: an unbounded floor without obstacles.
        moving: Moving obstacles.
    """

    robot: Robot
    rng: np.random.Generator | None = None
    obstacles: OccupancyGrid | None = None
    moving: tuple[MovingObstacle, ...] = field(default=())


@dataclass(frozen=True)
class CoppeliaSimOptions:
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


def _capable(capabilities: PlantCapabilities) -> Callable[[Any], Any]:
    """Attach capabilities to a factory, so that they are known without a plant."""

    def attach(factory: Any) -> Any:
        """Return the factory with the attribute ``capabilities``."""
        factory.capabilities = capabilities
        return factory

    return attach


def static_capabilities(factory: Any) -> PlantCapabilities:
    """Return the attribute ``capabilities`` of a factory of plants; without one, none."""
    found = getattr(factory, "capabilities", None)
    return found if isinstance(found, PlantCapabilities) else PlantCapabilities()


@_capable(_MUJOCO)
def mujoco_rollers(context: PlantContext) -> Plant:
    """MuJoCo with every roller of every wheel."""
    return simulation.MujocoPlant(
        context.robot, "rollers", context.rng, obstacles=context.obstacles, moving=context.moving
    )


@_capable(_MUJOCO)
def mujoco_balls(context: PlantContext) -> Plant:
    """MuJoCo with one ball per wheel: faster, without the vibration of rollers."""
    return simulation.MujocoPlant(
        context.robot, "ball", obstacles=context.obstacles, moving=context.moving
    )


@_capable(_WHEELS._replace(disturbable=True, forces=True))
def planar(context: PlantContext) -> Plant:
    """Planar rigid body with motors, wheel slip and friction, without obstacles."""
    return simulation.PlanarPlant(context.robot, context.rng)


@_capable(PlantCapabilities(disturbable=True, wheel_speeds=True))
def kinematic(context: PlantContext) -> Plant:
    """Exact execution of commands within the wheel speed limits."""
    return simulation.KinematicPlant(context.robot)


@_capable(PlantCapabilities(exclusive=True, forces=True, wheel_speeds=True))
def coppeliasim(context: PlantContext, parameters: CoppeliaSimOptions) -> Plant:
    """Robot in the open scene of a running CoppeliaSim."""
    scene = simulation.CoppeliaSimScene(**vars(parameters))
    return simulation.CoppeliaSimPlant(context.robot, scene)
