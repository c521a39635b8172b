"""Pictures of a MuJoCo world."""

from __future__ import annotations

from types import TracebackType

import mujoco
import numpy as np
from jaxtyping import UInt8

from omnidrive.arrays import Array
from omnidrive.visualization.opengl import offscreen
from omnidrive.visualization.overlays import Overlays

_MOST_GEOMS = 4000


class Canvas:
    """Draws a world without a window. Close it after use, or use it in a ``with``."""

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        """Find something to draw with.

        Args:
            model: The world.
            width: Of the pictures, in pixels.
            height: Of the pictures, in pixels.

        Raises:
            CannotDraw: There is no OpenGL.
        """
        self._model = model
        self._context, self._drawing = offscreen(model, width, height)
        self._scene = mujoco.MjvScene(model, _MOST_GEOMS)
        self._options = mujoco.MjvOption()
        self._view = mujoco.MjrRect(0, 0, width, height)

    def draw(
        self, data: mujoco.MjData, camera: mujoco.MjvCamera, marks: Overlays, caption: str = ""
    ) -> UInt8[Array, "height width 3"]:
        """A picture of the world, rows from the top, in red, green and blue.

        Args:
            data: The world's state, with its bodies' places computed.
            camera: Where it is seen from.
            marks: What is drawn on the floor.
            caption: Text in the corner.
        """
        self._context.make_current()
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            self._model, data, self._options, None, camera, everything, self._scene
        )
        marks.add_to(self._scene)
        mujoco.mjr_render(self._view, self._scene, self._drawing)
        if caption:
            mujoco.mjr_overlay(
                mujoco.mjtFont.mjFONT_NORMAL, mujoco.mjtGridPos.mjGRID_TOPLEFT, self._view,
                caption, "", self._drawing,
            )  # fmt: skip
        pixels = np.empty((self._view.height, self._view.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._view, self._drawing)
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Give back what it draws with; a second time, do nothing."""
        if self._context is not None:
            self._context.make_current()
            self._drawing.free()
            self._context.free()
            self._context = None

    def __del__(self) -> None:
        if hasattr(self, "_context"):
            self.close()

    def __enter__(self) -> Canvas:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
