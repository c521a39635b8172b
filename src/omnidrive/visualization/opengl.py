"""OpenGL without a window."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes.util import find_library
from importlib import import_module
from typing import Any

import mujoco

from omnidrive.errors import CannotDraw

_CHOICE = "MUJOCO_GL"
_OFF = {"disable", "disabled", "off", "false", "0"}
_KINDS = {"egl": "egl", "osmesa": "osmesa", "cgl": "cgl", "glfw": "glfw", "glx": "glfw",
          "wgl": "glfw"}  # fmt: skip
"""What MUJOCO_GL may say, and the module of MuJoCo that does it."""


def offscreen(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, mujoco.MjrContext]:
    """An OpenGL context without a window, and what MuJoCo needs to draw ``model`` in it.

    The environment variable MUJOCO_GL (`egl`, `osmesa`, `glfw`) decides how; without it, what the
    machine has: EGL, which also works without a display, OSMesa, or an invisible window.

    Args:
        model: What is drawn; the size and how finely are noted in it.
        width: Of the pictures, in pixels.
        height: Of the pictures, in pixels.

    Raises:
        CannotDraw: None works.
    """
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    quality = model.vis.quality  # without a graphics card fine surfaces take most of the time
    quality.numslices, quality.numstacks, quality.numquads = 28, 6, 1
    reasons = []
    for kind in _kinds():
        try:
            with _chosen(kind):
                context = import_module(f"mujoco.{_KINDS[kind]}").GLContext(width, height)
                context.make_current()
                drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, drawing)
        except Exception as error:  # each library fails in its own ways
            reasons.append(f"{kind}: {str(error).strip() or type(error).__name__}")
        else:
            return context, drawing
    raise CannotDraw(
        f"there is no OpenGL to draw with ({'; '.join(reasons) or 'no library found'}). Install "
        "EGL (Debian and Ubuntu: apt install libegl1) or OSMesa (libosmesa6), which work without "
        "a display, and set MUJOCO_GL to egl or osmesa if the wrong one is taken"
    )


def has_display() -> bool:
    """Whether there is a screen that windows can be on, as far as the environment says."""
    if sys.platform in {"win32", "darwin"}:
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _kinds() -> list[str]:
    """Ways to draw, the best first."""
    asked = os.environ.get(_CHOICE, "").lower().strip()
    if asked in _OFF:
        raise CannotDraw(f"drawing is switched off by {_CHOICE}={asked}; set it to egl or unset it")
    if asked in _KINDS:
        return [asked]
    if sys.platform == "darwin":
        return ["cgl", "glfw"]
    libraries = {"egl": "EGL", "osmesa": "OSMesa"}
    found = [kind for kind, library in libraries.items() if find_library(library)]
    return [*found, "glfw"] if has_display() else found


@contextmanager
def _chosen(kind: str) -> Iterator[None]:
    """MuJoCo looks at the variable when it first draws, to find OpenGL's functions."""
    before = os.environ.get(_CHOICE)
    os.environ[_CHOICE] = kind
    try:
        yield
    finally:
        if before is None:
            del os.environ[_CHOICE]
        else:
            os.environ[_CHOICE] = before
