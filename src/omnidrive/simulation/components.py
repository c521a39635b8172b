"""Factories of the plants of this package, which scenarios name, and their context."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from omnidrive import simulation  # imports only the modules of the plant in use
from omnidrive.maps import OccupancyGrid
from omnidrive.robot import Robot
from omnidrive.simulation.coppeliasim.scene import CoppeliaSimScene
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.plant import Plant, PlantCapabilities

_WHEELS = PlantCapabilities(wheel_speeds=True, wheel_torques=True)
_MUJOCO = _WHEELS._replace(disturbable=True, collides=True, renders=True, forces=True)


@dataclass(frozen=True, eq=False)
class PlantContext:
    """Context of a plant, an argument of its factory.

    A plant ignores what does not apply to it, such as ``obstacles`` without the capability
    ``collides``.

    Attributes:
        robot: The simulated robot.
        rng: Generator of the initial wheel angles, uniform in one roller pitch, for plants with
            rollers. None: 0 rad.
        obstacles: Map around the robot. None: an unbounded floor without obstacles.
        moving: Moving obstacles.
    """

    robot: Robot
    rng: np.random.Generator | None = None
    obstacles: OccupancyGrid | None = None
    moving: tuple[MovingObstacle, ...] = ()


def _capable(capabilities: PlantCapabilities) -> Callable[[Any], Any]:
    """Attach capabilities to a factory, so that they are known without a plant."""

    def attach(factory: Any) -> Any:
        """Return the factory with the attribute ``capabilities``."""
        factory.capabilities = capabilities
        return factory

    return attach


def static_capabilities(factory: Any) -> PlantCapabilities:
    """Return the ``capabilities`` of a plant factory; if it has none, they are all False."""
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
def coppeliasim(context: PlantContext, parameters: CoppeliaSimScene) -> Plant:
    """Robot in the open scene of a running CoppeliaSim."""
    return simulation.CoppeliaSimPlant(context.robot, parameters)
