"""Offscreen OpenGL contexts."""

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
"""Values of MUJOCO_GL and the modules of MuJoCo that implement them."""


def offscreen(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, mujoco.MjrContext]:
    """Return an OpenGL context without a window, and MuJoCo's resources to draw ``model`` in it.

    The environment variable MUJOCO_GL (`egl`, `osmesa`, `glfw`) selects the library. Otherwise the
    first available one is used: EGL, which needs no display, OSMesa, or an invisible window.

    Args:
        model: Model to draw; the picture size and the rendering quality are set in it.
        width: Width of the pictures, pixels.
        height: Height of the pictures, pixels.

    Raises:
        CannotDraw: No library works.
    """
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    quality = model.vis.quality  # coarse surfaces: fine ones are slow without a graphics card
    quality.numslices, quality.numstacks, quality.numquads = 28, 6, 1
    reasons = []
    for kind in _kinds():
        try:
            with _environment(kind):
                context = import_module(f"mujoco.{_KINDS[kind]}").GLContext(width, height)
                context.make_current()
                resources = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, resources)
        except Exception as error:  # the exceptions depend on the library
            reasons.append(f"{kind}: {str(error).strip() or type(error).__name__}")
        else:
            return context, resources
    raise CannotDraw(
        f"OpenGL is not available ({'; '.join(reasons) or 'no library found'}). Install "
        "EGL (Debian and Ubuntu: apt install libegl1) or OSMesa (libosmesa6), which work without "
        "a display, and set MUJOCO_GL to egl or osmesa to choose one"
    )


def has_display() -> bool:
    """Return whether the environment names a display for windows."""
    if sys.platform in {"win32", "darwin"}:
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _kinds() -> list[str]:
    """Return the libraries to try, the preferred one first."""
    choice = os.environ.get(_CHOICE, "").lower().strip()
    if choice in _OFF:
        raise CannotDraw(
            f"drawing is switched off by {_CHOICE}={choice}; set it to egl or unset it"
        )
    if choice in _KINDS:
        return [choice]
    if sys.platform == "darwin":
        return ["cgl", "glfw"]
    libraries = {"egl": "EGL", "osmesa": "OSMesa"}
    found = [kind for kind, library in libraries.items() if find_library(library)]
    return [*found, "glfw"] if has_display() else found


@contextmanager
def _environment(kind: str) -> Iterator[None]:
    """Set MUJOCO_GL, which MuJoCo reads when it first loads the functions of OpenGL."""
    before = os.environ.get(_CHOICE)
    os.environ[_CHOICE] = kind
    try:
        yield
    finally:
        if before is None:
            del os.environ[_CHOICE]
        else:
            os.environ[_CHOICE] = before
