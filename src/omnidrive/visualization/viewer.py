"""MuJoCo's own viewer, on a run as it happens."""

from __future__ import annotations

import sys
import warnings
from copy import copy
from importlib import import_module
from math import hypot
from threading import Thread
from time import monotonic, sleep
from types import TracebackType
from typing import Any

import mujoco
import numpy as np

from omnidrive.errors import CannotDraw
from omnidrive.visualization.camera import make_camera
from omnidrive.visualization.ghost_model import update_kinematics
from omnidrive.visualization.observer import Scene
from omnidrive.visualization.opengl import has_display
from omnidrive.visualization.overlays import Overlays, sample_path
from omnidrive.visualization.recording import FRAMES_PER_SECOND

_OPENING = 30.0  # s that a window may take to open
_LATE = 0.2  # s that the window may lag behind before it gives up to catch up
_STEP = 0.2  # of the robot's radius from point to point of its trail


class Viewer:
    """An :class:`~omnidrive.visualization.Observer` that shows a run in a window at real time.

    The run waits for the clock; one that is too slow for it is shown as fast as it goes. When the
    window is closed the run goes on without it, at full speed. The window shows a copy of the
    world, so that nothing which is done in it changes the run. Use it in a ``with``: at its end the
    window is closed.
    """

    def __init__(self) -> None:
        """Find a screen.

        Raises:
            CannotDraw: There is none.
        """
        _find_screen()
        self._handle: Any = None
        self._scene: Scene | None = None
        self._copy: mujoco.MjData | None = None
        self._path = np.empty((0, 2))
        self._trail: list[tuple[float, float]] = []
        self._began = 0.0

    @property
    def period(self) -> float:
        """Simulated time between frames, in s."""
        return 1.0 / FRAMES_PER_SECOND

    def begin(self, scene: Scene) -> None:
        """Open the window, or show another run in a new one.

        Raises:
            CannotDraw: It does not open.
        """
        self.close()
        self._scene, self._path = scene, sample_path(scene.reference)
        self._trail = [scene.position]
        model = copy(scene.model)
        self._copy = mujoco.MjData(model)
        self._show()
        self._handle = _open_window(model, self._copy)
        camera = make_camera(
            "auto", np.vstack([self._path, self._trail]), scene.robot.body_radius, 1.6
        )
        with self._handle.lock():
            seen = self._handle.cam
            seen.lookat[:] = camera.lookat
            seen.distance, seen.azimuth = camera.distance, camera.azimuth
            seen.elevation = camera.elevation
        self._began = monotonic()

    def update(self, t: float) -> None:
        """Wait until it is time, and show the scene as it is at ``t`` (s)."""
        if self._handle is None or self._scene is None:
            return
        if not self._handle.is_running():
            self.close()
            return
        robot = self._scene.robot
        x, y = self._scene.position
        if hypot(x - self._trail[-1][0], y - self._trail[-1][1]) > _STEP * robot.body_radius:
            self._trail.append((x, y))
        marks = Overlays(
            self._path,
            np.array([*self._trail, (x, y)]),
            self._scene.reference.at(t).pose,
            robot.body_radius,
        )
        with self._handle.lock():
            self._handle.user_scn.ngeom = 0
            marks.add_to(self._handle.user_scn)
            self._show()
        self._handle.sync()
        ahead = self._began + t - monotonic()
        if ahead > 0.0:
            sleep(ahead)
        elif ahead < -_LATE:
            self._began -= ahead

    def _show(self) -> None:
        """Make the copy of the world what the world is now."""
        assert self._scene is not None
        assert self._copy is not None
        world = self._scene.data
        self._copy.qpos[:], self._copy.mocap_pos[:] = world.qpos, world.mocap_pos
        self._copy.time = world.time
        update_kinematics(self._copy.model, self._copy)

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._handle is not None:
            self._handle.close()
            self._handle = None

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _find_screen() -> None:
    """Refuse to go on without a screen."""
    way_out = "a film needs none: --video FILE.gif"
    if not has_display():
        raise CannotDraw(
            f"there is no display for the viewer's window (DISPLAY is not set); {way_out}"
        )
    try:
        glfw = import_module("glfw")  # both look for libraries when they are imported
        import_module("mujoco.viewer")
    except Exception as error:  # libraries for windows fail in their own ways
        raise CannotDraw(f"the viewer cannot be loaded: {error}; {way_out}") from None
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        ready = sys.platform == "darwin" or glfw.init()  # there it is for MuJoCo to do
    if not ready:
        reasons = "; ".join(str(each.message) for each in said) or "no reason given"
        raise CannotDraw(f"there is no display for the viewer's window: {reasons}; {way_out}")


def _open_window(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    """The viewer's handle.

    MuJoCo opens the window in a thread of its own, and waits for ever if that fails there: so the
    waiting is bounded.
    """
    from mujoco import viewer  # noqa: PLC0415 - looks for a screen when it is imported

    opened: list[Any] = []

    def launch() -> None:
        """Put the window, or what went wrong, where the waiting looks."""
        try:
            opened.append(
                viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
            )
        except Exception as error:
            opened.append(error)

    thread = Thread(target=launch, daemon=True)
    thread.start()
    thread.join(_OPENING)
    if not opened or isinstance(opened[0], Exception):
        reason = opened[0] if opened else f"no window after {_OPENING:g} s"
        raise CannotDraw(f"the viewer's window does not open: {reason}")
    return opened[0]
