"""Films of recorded runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from math import hypot
from pathlib import Path
from typing import get_args

import mujoco
import numpy as np
from jaxtyping import UInt8

from omnidrive.arrays import Array
from omnidrive.errors import CannotWrite, InvalidInput
from omnidrive.files.bounded_file import one_line
from omnidrive.geometry import Pose
from omnidrive.visualization.camera import CameraName, follow, follows, make_camera
from omnidrive.visualization.canvas import Canvas
from omnidrive.visualization.ghost_model import update_kinematics
from omnidrive.visualization.opengl import offscreen
from omnidrive.visualization.overlays import Overlays
from omnidrive.visualization.recording import FRAMES_PER_SECOND, MAX_FRAMES, Recording
from omnidrive.visualization.video_file import check_encoder, write_gif, write_mp4

_USUAL = {".mp4": (960, 540), ".gif": (640, 360)}
_MOST = {".mp4": MAX_FRAMES, ".gif": 800}
"""Frames; those of a GIF are all in memory until it is written."""
_SIZES = (64, 1920)  # pixels, of either side


def check_film(path: Path | str) -> None:
    """Refuse a film that could not be made, before there is anything to film.

    Raises:
        InvalidInput: The name ends neither in .mp4 nor in .gif.
        MissingExtra: Nothing can write an MP4.
        CannotDraw: There is no OpenGL.
        CannotWrite: There is no such folder.
    """
    path = Path(path)
    if _suffix(path) == ".mp4":
        check_encoder()
    if not path.parent.is_dir() or path.is_dir() or not os.access(path.parent, os.W_OK):
        raise CannotWrite(
            f"cannot write the film {one_line(str(path))}: name a file in a folder that is there "
            "and may be changed"
        )
    empty = mujoco.MjModel.from_xml_string("<mujoco/>")
    context, drawing = offscreen(empty, 64, 64)
    drawing.free()
    context.free()


def film(
    recording: Recording,
    path: Path | str,
    *,
    size: tuple[int, int] | None = None,
    camera: CameraName = "auto",
    progress: Callable[[int, int], None] | None = None,
) -> float:
    """Draw a recording, at real time, or faster if it were too long, and write the film.

    25 frames a second. A GIF has at most 800 frames, an MP4 15,000: a longer run plays 2, 3, ...
    times as fast. The file is whole or absent.

    Args:
        recording: What was seen.
        path: A file that ends in .mp4 or .gif; one that is there is replaced.
        size: Width and height in pixels, even numbers from 64 to 1920; 960 x 540, or 640 x 360 of
            a GIF.
        camera: Where from.
        progress: Told after every frame how many are done, and of how many.

    Returns:
        How much faster than real time it plays.

    Raises:
        InvalidInput: The name or the size is not as it must be, or there is no such camera.
        MissingExtra: Nothing can write an MP4.
        CannotDraw: There is no OpenGL.
        CannotWrite: The file cannot be written.
    """
    path = Path(path)
    kind = _suffix(path)
    width, height = _checked(size or _USUAL[kind])
    if camera not in get_args(CameraName):
        raise InvalidInput(
            f"there is no camera '{camera}'; there are {', '.join(get_args(CameraName))}"
        )
    stride = -(-len(recording.t) // _MOST[kind])
    chosen = range(0, len(recording.t), stride)
    speed = _speed(recording, stride)
    part = path.with_name(path.name + ".part")
    try:
        with Canvas(recording.model, width, height) as canvas:
            shots = _Shots(recording, canvas, camera, width / height, speed=speed)
            pictures = _counted(map(shots.picture, chosen), len(chosen), progress)
            if kind == ".mp4":
                write_mp4(part, pictures, FRAMES_PER_SECOND)
            else:
                sample = np.vstack([shots.picture(chosen[k]) for k in (0, -1)])
                write_gif(part, pictures, FRAMES_PER_SECOND, sample)
        os.replace(part, path)
    except OSError as error:
        raise CannotWrite(
            f"cannot write the film {one_line(str(path))}: {error.strerror or error}"
        ) from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
    return speed


def _suffix(path: Path) -> str:
    if path.suffix.lower() not in _USUAL:
        raise InvalidInput(f"{one_line(str(path))}: films are written as .mp4 or .gif")
    return path.suffix.lower()


def _checked(size: tuple[int, int]) -> tuple[int, int]:
    least, most = _SIZES
    if any(side != int(side) or side % 2 or not least <= side <= most for side in size):
        raise InvalidInput(
            f"a film of {size[0]:g} x {size[1]:g} pixels: need even numbers from {least} to {most}"
        )
    return size


def _speed(recording: Recording, stride: int) -> float:
    """Simulated time per time of the film."""
    if len(recording.t) < 2:
        return 1.0
    step = float(recording.t[-1] - recording.t[0]) / (len(recording.t) - 1)
    speed = stride * step * FRAMES_PER_SECOND
    whole = round(speed)  # but for frames that wait for the next physics step
    return float(whole) if abs(speed - whole) < 0.05 else round(speed, 2)


class _Shots:
    """The frames of a film."""

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
        shown = np.vstack([recording.path, recording.positions[:, :2]])
        self._camera = make_camera(name, shown, recording.radius, aspect)
        self._follows = follows(name, shown, recording.radius)
        self._fast = f"   x {speed:g}" if speed != 1.0 else ""

    def picture(self, k: int) -> UInt8[Array, "height width 3"]:
        """The ``k``-th frame of the recording."""
        recording, data = self._recording, self._data
        data.qpos[:], data.mocap_pos[:] = recording.positions[k], recording.moving[k]
        update_kinematics(recording.model, data)
        trail = recording.positions[: k + 1, :2]
        if self._follows:
            follow(self._camera, trail[-1])
        target = Pose(*recording.target[k].tolist())
        off = 1e3 * hypot(target.x - trail[-1, 0], target.y - trail[-1, 1])
        caption = f"{recording.t[k]:.1f} s   error {off:.1f} mm{self._fast}"
        marks = Overlays(recording.path, trail, target, recording.radius)
        return self._canvas.draw(data, self._camera, marks, caption)


def _counted(
    pictures: Iterator[UInt8[Array, "height width 3"]],
    count: int,
    progress: Callable[[int, int], None] | None,
) -> Iterator[UInt8[Array, "height width 3"]]:
    for done, picture in enumerate(pictures, 1):
        yield picture
        if progress is not None:
            progress(done, count)
