"""Offscreen pictures of a MuJoCo model."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import UInt8

from omnidrive.arrays import Array
from omnidrive.visualization.opengl import offscreen
from omnidrive.visualization.overlays import Overlays

_MAX_GEOMS = 4000  # of the model and the overlays; further ones are not drawn


class Canvas:
    """Offscreen renderer of a model. Close it after use, or use it in a ``with`` statement."""

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        """Create an OpenGL context.

        Args:
            model: Model to draw; the picture size and the rendering quality are set in it.
            width: Width of the pictures, pixels.
            height: Height of the pictures, pixels.

        Raises:
            CannotDraw: OpenGL is not available.
        """
        self._model = model
        self._context, self._resources = offscreen(model, width, height)
        self._scene = mujoco.MjvScene(model, _MAX_GEOMS)
        self._options = mujoco.MjvOption()
        self._view = mujoco.MjrRect(0, 0, width, height)

    def draw(
        self, data: mujoco.MjData, camera: mujoco.MjvCamera, overlays: Overlays, caption: str = ""
    ) -> UInt8[Array, "height width 3"]:
        """Return a picture as red, green and blue from 0 to 255, the top row first.

        Args:
            data: State of the model with up-to-date positions, as after ``mj_forward``.
            camera: Point of view, see :func:`~omnidrive.visualization.make_camera`.
            overlays: Drawings on the floor.
            caption: Text in the upper left corner.
        """
        self._context.make_current()
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            self._model, data, self._options, None, camera, everything, self._scene
        )
        overlays.add_to(self._scene)
        mujoco.mjr_render(self._view, self._scene, self._resources)
        if caption:
            mujoco.mjr_overlay(
                mujoco.mjtFont.mjFONT_NORMAL, mujoco.mjtGridPos.mjGRID_TOPLEFT, self._view,
                caption, "", self._resources,
            )  # fmt: skip
        pixels = np.empty((self._view.height, self._view.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._view, self._resources)
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Release the OpenGL context; a second call does nothing."""
        if self._context is not None:
            self._context.make_current()
            self._resources.free()
            self._context.free()
            self._context = None

    def __del__(self) -> None:
        if hasattr(self, "_context"):
            self.close()

    def __enter__(self) -> Canvas:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
