"""Video files.

GIF is written by Pillow, a required dependency. MP4 needs an encoder: the command ffmpeg, or OpenCV
(extra `video`), whose packages for Linux and Windows contain an FFmpeg under the LGPL.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory, TemporaryFile

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from omnidrive.arrays import Array
from omnidrive.errors import CannotWrite, MissingExtra

_UNCHANGED = 255  # index of the transparent colour, which keeps the previous frame's pixel
_COMMAND = "ffmpeg"
_ENCODERS = {
    "libx264": ["-preset", "veryfast", "-crf", "21"],
    "libopenh264": ["-b:v", "3M"],
    "libvpx-vp9": ["-deadline", "realtime", "-cpu-used", "8", "-b:v", "2M"],
    "mpeg4": ["-q:v", "4"],
}
"""Encoders of ffmpeg in order of preference; their availability depends on its build."""


def check_encoder() -> None:
    """Check that an encoder for MP4 is available.

    Raises:
        MissingExtra: There is none.
    """
    if which(_COMMAND) is None and find_spec("cv2") is None:
        raise MissingExtra(
            "an MP4 needs an encoder: install the command ffmpeg, or pip install "
            "opencv-python-headless; a film whose name ends in .gif needs neither"
        )


def write_gif(
    path: Path,
    frames: Iterator[UInt8[Array, "height width 3"]],
    rate: float,
    sample: UInt8[Array, "rows columns 3"],
) -> None:
    """Write frames as a repeating GIF; Pillow keeps all of them in memory.

    All frames share 255 colours. Pixels that keep their colour are written as transparent, which
    makes the file small.

    Args:
        path: The file.
        frames: Frames of the same size; at least one.
        rate: Frames per second; the interval is rounded to hundredths of a second.
        sample: Picture with all important colours.
    """
    palette = Image.fromarray(sample).quantize(_UNCHANGED, dither=Image.Dither.NONE)

    def quantized(frame: UInt8[Array, "height width 3"]) -> Image.Image:
        """Return the frame in the colours of the palette."""
        return Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)

    def changes(first: Image.Image) -> Iterator[Image.Image]:
        """Yield the changed pixels of each frame; the others are transparent."""
        before = np.asarray(first)
        for frame in frames:
            now = np.asarray(quantized(frame))
            changed = Image.fromarray(np.where(now == before, np.uint8(_UNCHANGED), now))
            changed.putpalette(palette.getpalette() or [])
            before = now
            yield changed

    first = quantized(next(frames))
    with path.open("wb") as file:
        first.save(
            file, format="GIF", save_all=True, append_images=changes(first), loop=0, disposal=1,
            duration=round(100.0 / rate) * 10, transparency=_UNCHANGED, optimize=False,
        )  # fmt: skip


def write_mp4(path: Path, frames: Iterator[UInt8[Array, "height width 3"]], rate: float) -> None:
    """Write frames as an MP4.

    Args:
        path: The file.
        frames: Frames of the same size, with even width and height; at least one.
        rate: Frames per second.

    Raises:
        MissingExtra: There is no encoder.
        CannotWrite: The encoder fails.
    """
    check_encoder()
    write = _write_with_ffmpeg if which(_COMMAND) else _write_with_opencv
    first = next(frames)
    write(path, chain([first], frames), rate, (first.shape[1], first.shape[0]))


def _write_with_opencv(
    path: Path,
    frames: Iterable[UInt8[Array, "height width 3"]],
    rate: float,
    size: tuple[int, int],
) -> None:
    """Write VP9, which browsers play: the FFmpeg of OpenCV has no encoder for H.264."""
    import cv2  # noqa: PLC0415 - an extra

    with TemporaryDirectory(dir=path.parent, prefix=".film-") as folder:
        file = Path(folder) / "film.mp4"  # OpenCV derives the format from the suffix
        writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"vp09"), rate, size)
        if not writer.isOpened():
            raise CannotWrite("OpenCV cannot write an MP4 here; install the command ffmpeg")
        try:
            for frame in frames:
                writer.write(np.ascontiguousarray(frame[:, :, ::-1]))
        finally:
            writer.release()
        os.replace(file, path)


def _write_with_ffmpeg(
    path: Path,
    frames: Iterable[UInt8[Array, "height width 3"]],
    rate: float,
    size: tuple[int, int],
) -> None:
    command = [
        _COMMAND, "-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo",
        "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", f"{rate:g}", "-i", "-",
        "-an", "-c:v", *_best_encoder(), "-pix_fmt", "yuv420p", "-movflags", "+faststart",
        "-f", "mp4", f"file:{path}",
    ]  # fmt: skip
    with TemporaryFile() as messages:
        encoder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=messages, stderr=messages)
        assert encoder.stdin is not None
        try:
            with suppress(BrokenPipeError):  # ffmpeg reports the reason
                for frame in frames:
                    encoder.stdin.write(frame.tobytes())
        except BaseException:
            encoder.kill()
            raise
        finally:
            with suppress(BrokenPipeError):  # close() repeats a failed write
                encoder.stdin.close()
            status = encoder.wait()
        if status != 0:
            messages.seek(0)
            text = messages.read(2000).decode(errors="replace").strip().replace("\n", "; ")
            raise CannotWrite(f"ffmpeg cannot write the film: {text or f'status {status}'}")


def _best_encoder() -> list[str]:
    """Return the preferred available encoder of ffmpeg with its options."""
    listed = subprocess.run(
        [_COMMAND, "-hide_banner", "-encoders"],
        capture_output=True, check=False, timeout=60, stdin=subprocess.DEVNULL,
    ).stdout.decode(errors="replace").split()  # fmt: skip
    for name, settings in _ENCODERS.items():
        if name in listed:
            return [name, *settings]
    raise CannotWrite(f"ffmpeg has none of the encoders {', '.join(_ENCODERS)}; write a .gif")
