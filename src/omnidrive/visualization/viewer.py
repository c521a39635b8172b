"""Display of a running simulation in MuJoCo's viewer."""

from __future__ import annotations

import sys
import warnings
from copy import copy
from importlib import import_module
from math import hypot
from threading import Thread
from time import monotonic, sleep
from typing import Any

import mujoco
import numpy as np

from omnidrive.errors import CannotDraw
from omnidrive.visualization.camera import make_camera
from omnidrive.visualization.display_model import update_kinematics
from omnidrive.visualization.observer import Scene
from omnidrive.visualization.opengl import has_display
from omnidrive.visualization.overlays import Overlays, sample_path
from omnidrive.visualization.recording import FRAMES_PER_SECOND

_OPEN_TIMEOUT = 30.0  # s; longest wait for the window
_MAX_DELAY = 0.2  # s; delay beyond which the clock is shifted instead of catching up
_TRAIL_STEP = 0.2  # robot radii between points of the trail


class Viewer:
    """An :class:`~omnidrive.visualization.Observer` that shows a run in a window in real time.

    The simulation waits for the clock; if it is slower than real time, it is not delayed. When the
    window is closed, the simulation continues at full speed. The window shows a copy of the state,
    so that actions in it do not change the run. Use it in a ``with``, which closes the window.
    """

    def __init__(self) -> None:
        """Check that there is a display.

        Raises:
            CannotDraw: There is none.
        """
        _check_display()
        self._handle: Any = None
        self._scene: Scene | None = None
        self._copy: mujoco.MjData | None = None
        self._path = np.empty((0, 2))
        self._trail: list[tuple[float, float]] = []
        self._start = 0.0

    @property
    def period(self) -> float:
        """Simulated time between frames, s."""
        return 1.0 / FRAMES_PER_SECOND

    def begin(self, scene: Scene) -> None:
        """Open a new window for the run.

        Raises:
            CannotDraw: The window does not open.
        """
        self.close()
        self._scene, self._path = scene, sample_path(scene.reference)
        self._trail = [scene.position]
        model = copy(scene.model)
        self._copy = mujoco.MjData(model)
        self._copy_state()
        self._handle = _open_window(model, self._copy)
        camera = make_camera(
            "auto", np.vstack([self._path, self._trail]), scene.robot.body_radius, 1.6
        )
        with self._handle.lock():
            view = self._handle.cam
            view.lookat[:] = camera.lookat
            view.distance, view.azimuth = camera.distance, camera.azimuth
            view.elevation = camera.elevation
        self._start = monotonic()

    def update(self, t: float) -> None:
        """Show the state at ``t`` (s) and wait until the clock reaches it."""
        if self._handle is None or self._scene is None:
            return
        if not self._handle.is_running():
            self.close()
            return
        robot = self._scene.robot
        x, y = self._scene.position
        if hypot(x - self._trail[-1][0], y - self._trail[-1][1]) > _TRAIL_STEP * robot.body_radius:
            self._trail.append((x, y))
        overlays = Overlays(
            self._path,
            np.array([*self._trail, (x, y)]),
            self._scene.reference.at(t).pose,
            robot.body_radius,
        )
        with self._handle.lock():
            self._handle.user_scn.ngeom = 0
            overlays.add_to(self._handle.user_scn)
            self._copy_state()
        self._handle.sync()
        ahead = self._start + t - monotonic()
        if ahead > 0.0:
            sleep(ahead)
        elif ahead < -_MAX_DELAY:
            self._start -= ahead

    def _copy_state(self) -> None:
        """Copy the current state of the scene."""
        assert self._scene is not None
        assert self._copy is not None
        state = self._scene.data
        self._copy.qpos[:], self._copy.mocap_pos[:] = state.qpos, state.mocap_pos
        self._copy.time = state.time
        update_kinematics(self._copy.model, self._copy)

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._handle is not None:
            self._handle.close()
            self._handle = None

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _check_display() -> None:
    """Raise CannotDraw without a display."""
    advice = "a film needs none: --video FILE.gif"
    if not has_display():
        raise CannotDraw(
            f"there is no display for the viewer's window (DISPLAY is not set); {advice}"
        )
    try:
        glfw = import_module("glfw")  # both load libraries at import
        import_module("mujoco.viewer")
    except Exception as error:  # the exceptions depend on the library
        raise CannotDraw(f"the viewer cannot be loaded: {error}; {advice}") from None
    with warnings.catch_warnings(record=True) as messages:
        warnings.simplefilter("always")
        ready = sys.platform == "darwin" or glfw.init()  # on macOS MuJoCo initialises GLFW
    if not ready:
        reasons = "; ".join(str(each.message) for each in messages) or "no reason given"
        raise CannotDraw(f"there is no display for the viewer's window: {reasons}; {advice}")


def _open_window(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    """Open the window and return the handle of the viewer.

    MuJoCo opens the window in another thread and blocks if that fails; this wait has a timeout.
    """
    from mujoco import viewer  # noqa: PLC0415 - needs a display at import

    opened: list[Any] = []

    def launch() -> None:
        """Store the handle or the exception in ``opened``."""
        try:
            opened.append(
                viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
            )
        except Exception as error:
            opened.append(error)

    thread = Thread(target=launch, daemon=True)
    thread.start()
    thread.join(_OPEN_TIMEOUT)
    if not opened or isinstance(opened[0], Exception):
        reason = opened[0] if opened else f"no window after {_OPEN_TIMEOUT:g} s"
        raise CannotDraw(f"the viewer's window does not open: {reason}")
    return opened[0]
