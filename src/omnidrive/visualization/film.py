"""Films of recorded runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from math import hypot
from pathlib import Path
from typing import get_args

import mujoco
import numpy as np
from jaxtyping import UInt8

from omnidrive.arrays import Array
from omnidrive.errors import CannotWrite, InvalidInput, one_line
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.geometry import Pose
from omnidrive.parameter import check_choice
from omnidrive.visualization.camera import CameraName, follow, is_following, make_camera
from omnidrive.visualization.canvas import Canvas
from omnidrive.visualization.display_model import update_kinematics
from omnidrive.visualization.opengl import offscreen
from omnidrive.visualization.overlays import Overlays
from omnidrive.visualization.recording import FRAMES_PER_SECOND, MAX_FRAMES, Recording
from omnidrive.visualization.video_file import check_encoder, write_gif, write_mp4

_DEFAULT_SIZES = {".mp4": (960, 540), ".gif": (640, 360)}
_MAX_FRAMES_BY_SUFFIX = {".mp4": MAX_FRAMES, ".gif": 800}
"""Largest number of frames; those of a GIF are all kept in memory."""
_SIDES = (64, 1920)  # pixels; limits of width and height


def check_film(path: StrPath) -> None:
    """Check, before a run, that a film can be made.

    Raises:
        InvalidInput: The name ends neither in .mp4 nor in .gif.
        MissingExtra: There is no encoder for MP4.
        CannotDraw: OpenGL is not available.
        CannotWrite: The folder does not exist or is not writable.
    """
    path = to_path(path)
    if _suffix(path) == ".mp4":
        check_encoder()
    if not path.parent.is_dir() or path.is_dir() or not os.access(path.parent, os.W_OK):
        raise CannotWrite(
            f"cannot write the film {one_line(str(path))}: name a file in an existing, writable "
            "folder"
        )
    empty = mujoco.MjModel.from_xml_string("<mujoco/>")
    context, resources = offscreen(empty, 64, 64)
    resources.free()
    context.free()


def film(
    recording: Recording,
    path: StrPath,
    *,
    size: tuple[int, int] | None = None,
    camera: CameraName = "auto",
    progress: Callable[[int, int], None] | None = None,
) -> float:
    """Draw a recording and write it as a film, in real time or, if it is long, faster.

    The film has 25 frames per second. A GIF has at most 800 frames and an MP4 15,000; a longer run
    plays 2, 3, ... times as fast. An incomplete file is removed.

    Args:
        recording: The recording.
        path: File that ends in .mp4 or .gif; an existing one is replaced.
        size: Width and height in pixels, even numbers from 64 to 1920; by default 960 x 540, for
            a GIF 640 x 360.
        camera: Kind of camera.
        progress: Called after every frame with the number of frames done and their total.

    Returns:
        Playback speed relative to real time.

    Raises:
        InvalidInput: The name, the size or the camera is invalid.
        MissingExtra: There is no encoder for MP4.
        CannotDraw: OpenGL is not available.
        CannotWrite: The file cannot be written.
    """
    path = to_path(path)
    kind = _suffix(path)
    width, height = _check_size(size or _DEFAULT_SIZES[kind])
    check_choice("camera", camera, get_args(CameraName))
    stride = -(-len(recording.t) // _MAX_FRAMES_BY_SUFFIX[kind])
    chosen = range(0, len(recording.t), stride)
    speed = _speed(recording, stride)
    with output_file(path) as part, Canvas(recording.model, width, height) as canvas:
        renderer = _FrameRenderer(recording, canvas, camera, width / height, speed=speed)
        frames = _report_progress(map(renderer.draw, chosen), len(chosen), progress)
        if kind == ".mp4":
            write_mp4(part, frames, FRAMES_PER_SECOND)
        else:
            sample = np.vstack([renderer.draw(chosen[k]) for k in (0, -1)])
            write_gif(part, frames, FRAMES_PER_SECOND, sample)
    return speed


def _suffix(path: Path) -> str:
    if path.suffix.lower() not in _DEFAULT_SIZES:
        raise InvalidInput(f"{one_line(str(path))}: films are written as .mp4 or .gif")
    return path.suffix.lower()


def _check_size(size: tuple[int, int]) -> tuple[int, int]:
    minimum, maximum = _SIDES
    if any(side != int(side) or side % 2 or not minimum <= side <= maximum for side in size):
        raise InvalidInput(
            f"a film of {size[0]:g} x {size[1]:g} pixels: need even numbers from {minimum} to "
            f"{maximum}"
        )
    return size


def _speed(recording: Recording, stride: int) -> float:
    """Return the simulated time per second of the film."""
    if len(recording.t) < 2:
        return 1.0
    step = float(recording.t[-1] - recording.t[0]) / (len(recording.t) - 1)
    speed = stride * step * FRAMES_PER_SECOND
    whole = round(speed)  # frames can be late by a physics step
    return float(whole) if abs(speed - whole) < 0.05 else round(speed, 2)


class _FrameRenderer:
    """Drawing of the frames of a film."""

    def __init__(
        self,
        recording: Recording,
        canvas: Canvas,
        name: CameraName,
        aspect: float,
        *,
        speed: float,
    ) -> None:
        self._recording, self._canvas = recording, canvas
        self._data = mujoco.MjData(recording.model)
        points = np.vstack([recording.path, recording.qpos[:, :2]])
        self._camera = make_camera(name, points, recording.radius, aspect)
        self._follow = is_following(name, points, recording.radius)
        self._speed_note = f"   x {speed:g}" if speed != 1.0 else ""

    def draw(self, k: int) -> UInt8[Array, "height width 3"]:
        """Draw frame ``k`` of the recording."""
        recording, data = self._recording, self._data
        data.qpos[:], data.mocap_pos[:] = recording.qpos[k], recording.mocap_positions[k]
        update_kinematics(recording.model, data)
        trail = recording.qpos[: k + 1, :2]
        if self._follow:
            follow(self._camera, trail[-1])
        target = Pose(*recording.target[k].tolist())
        error = 1e3 * hypot(target.x - trail[-1, 0], target.y - trail[-1, 1])
        caption = f"{recording.t[k]:.1f} s   error {error:.1f} mm{self._speed_note}"
        overlays = Overlays(recording.path, trail, target, recording.radius)
        return self._canvas.draw(data, self._camera, overlays, caption)


def _report_progress(
    frames: Iterator[UInt8[Array, "height width 3"]],
    count: int,
    progress: Callable[[int, int], None] | None,
) -> Iterator[UInt8[Array, "height width 3"]]:
    for done, frame in enumerate(frames, 1):
        yield frame
        if progress is not None:
            progress(done, count)
