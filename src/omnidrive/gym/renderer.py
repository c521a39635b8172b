"""Pictures of the tracking environment."""

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
    DisplayModel,
    Overlays,
    follow,
    is_following,
    make_camera,
    sample_path,
)
from omnidrive.visualization.observer import RenderedPlant

_MAX_TRAIL = 20_000  # points


class Renderer:
    """Renderer of a plant; it allocates nothing before the first picture."""

    def __init__(
        self,
        plant: Plant,
        robot: Robot,
        reference: Reference,
        size: tuple[int, int],
        obstacles: OccupancyGrid | None,
    ) -> None:
        """Store the plant and the size of the pictures.

        Args:
            plant: The plant.
            robot: Its robot.
            reference: The reference that it tracks.
            size: Width and height of the picture, pixels.
            obstacles: Map to draw if the plant has no model to render.

        Raises:
            InvalidInput: The picture is too small or too large.
        """
        if not all(16 <= side <= 1920 for side in size):
            raise InvalidInput(f"a picture of {size} pixels: need 16 to 1920 for width and height")
        self._plant, self._robot, self._reference = plant, robot, reference
        self._size, self._obstacles = size, obstacles
        self._canvas: Canvas | None = None
        self._display: DisplayModel | None = None
        self._state: PlantState | None = None
        self._wheels = np.zeros(len(robot.mounts))
        self._trail: list[tuple[float, float]] = []

    def begin(self, state: PlantState) -> None:
        """Start a run with this state."""
        self._state, self._wheels = state, np.zeros(len(self._robot.mounts))
        self._trail = [state.pose[:2]]

    def advance(self, state: PlantState, dt: float) -> None:
        """Update the state after a step of ``dt`` (s)."""
        if self._display is not None and self._state is not None:
            self._wheels = self._display.next_wheel_angles(self._state, state, self._wheels, dt)
        self._state = state
        self._trail.append(state.pose[:2])
        if len(self._trail) > _MAX_TRAIL:
            self._trail = self._trail[::2]

    def draw(self, t: float) -> UInt8[Array, "height width 3"]:
        """Draw the picture at ``t`` (s).

        Raises:
            CannotDraw: OpenGL is not available.
        """
        assert self._state is not None
        source = (
            cast(RenderedPlant, self._plant)
            if self._plant.capabilities.renders
            else self._update_display(t)
        )
        if self._canvas is None:
            self._canvas = Canvas(source.model, *self._size)
        path, radius = sample_path(self._reference), self._robot.body_radius
        camera = make_camera("auto", path, radius, self._size[0] / self._size[1])
        if is_following("auto", path, radius):
            follow(camera, np.array(self._trail[-1]))
        overlays = Overlays(path, np.array(self._trail), self._reference.at(t).pose, radius)
        return self._canvas.draw(source.data, camera, overlays)

    def close(self) -> None:
        """Release the OpenGL context; a second call does nothing."""
        if self._canvas is not None:
            self._canvas.close()
            self._canvas = None

    def _update_display(self, t: float) -> DisplayModel:
        assert self._state is not None
        if self._display is None:
            self._display = DisplayModel(self._robot, obstacles=self._obstacles)
        self._display.set_pose(t, self._state.pose, self._wheels)
        return self._display
