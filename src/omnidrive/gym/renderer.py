"""Pictures of an environment, drawn when they are asked for."""

from __future__ import annotations

from typing import cast

import numpy as np
from jaxtyping import UInt8

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.maps import OccupancyGrid
from omnidrive.reference import Reference
from omnidrive.robot import Robot
from omnidrive.simulation import Plant, PlantState
from omnidrive.visualization import (
    Canvas,
    GhostModel,
    Overlays,
    follow,
    follows,
    make_camera,
    sample_path,
)
from omnidrive.visualization.observer import RenderedPlant

_MOST = 20_000  # points of a trail


class Renderer:
    """What a plant looks like now. Nothing is made before the first picture."""

    def __init__(
        self,
        plant: Plant,
        robot: Robot,
        reference: Reference,
        size: tuple[int, int],
        obstacles: OccupancyGrid | None,
    ) -> None:
        """Remember what is to be drawn.

        Args:
            plant: What moves.
            robot: Who it is.
            reference: What it should do.
            size: Of the picture, in pixels.
            obstacles: The map around a plant that has none of its own.

        Raises:
            InvalidInput: The picture is too small or too large.
        """
        if not all(16 <= side <= 1920 for side in size):
            raise InvalidInput(f"a picture of {size} pixels: need 16 to 1920 in both directions")
        self._plant, self._robot, self._reference = plant, robot, reference
        self._size, self._obstacles = size, obstacles
        self._canvas: Canvas | None = None
        self._puppet: GhostModel | None = None
        self._state: PlantState | None = None
        self._wheels = np.zeros(len(robot.mounts))
        self._trail: list[tuple[float, float]] = []

    def begin(self, state: PlantState) -> None:
        """A run begins."""
        self._state, self._wheels = state, np.zeros(len(self._robot.mounts))
        self._trail = [state.pose[:2]]

    def moved(self, state: PlantState, dt: float) -> None:
        """The robot moved for ``dt`` s."""
        if self._puppet is not None and self._state is not None:
            self._wheels = self._puppet.turn_wheels(self._state, state, self._wheels, dt)
        self._state = state
        self._trail.append(state.pose[:2])
        if len(self._trail) > _MOST:
            self._trail = self._trail[::2]

    def draw(self, t: float) -> UInt8[Array, "height width 3"]:
        """The picture at ``t`` (s).

        Raises:
            CannotDraw: There is no OpenGL.
        """
        assert self._state is not None
        world = (
            cast(RenderedPlant, self._plant) if self._plant.capabilities.renders else self._stand(t)
        )
        if self._canvas is None:
            self._canvas = Canvas(world.model, *self._size)
        path, radius = sample_path(self._reference), self._robot.body_radius
        camera = make_camera("auto", path, radius, self._size[0] / self._size[1])
        if follows("auto", path, radius):
            follow(camera, np.array(self._trail[-1]))
        marks = Overlays(path, np.array(self._trail), self._reference.at(t).pose, radius)
        return self._canvas.draw(world.data, camera, marks)

    def close(self) -> None:
        """Give back what is drawn with; a second time, do nothing."""
        if self._canvas is not None:
            self._canvas.close()
            self._canvas = None

    def _stand(self, t: float) -> GhostModel:
        assert self._state is not None
        if self._puppet is None:
            self._puppet = GhostModel(self._robot, obstacles=self._obstacles)
        self._puppet.set_pose(t, self._state.pose, self._wheels)
        return self._puppet
