"""Files of moving pictures.

GIF is written by Pillow, which is always there. MP4 needs an encoder: the command ffmpeg, or OpenCV
(extra `video`), whose packages for Linux and Windows hold an FFmpeg under the LGPL.
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

_SAME = 255  # index of the colour that is none: what was there before stays
_COMMAND = "ffmpeg"
_ENCODERS = {
    "libx264": ["-preset", "veryfast", "-crf", "21"],
    "libopenh264": ["-b:v", "3M"],
    "libvpx-vp9": ["-deadline", "realtime", "-cpu-used", "8", "-b:v", "2M"],
    "mpeg4": ["-q:v", "4"],
}
"""Of ffmpeg, the best first; which of them it has depends on who built it."""


def check_encoder() -> None:
    """Refuse to go on if nothing here can write an MP4.

    Raises:
        MissingExtra: Nothing can.
    """
    if which(_COMMAND) is None and find_spec("cv2") is None:
        raise MissingExtra(
            "an MP4 needs an encoder: install the command ffmpeg, or pip install "
            "'omnidrive[video]'; a film whose name ends in .gif needs neither"
        )


def write_gif(
    path: Path,
    pictures: Iterator[UInt8[Array, "height width 3"]],
    per_second: float,
    sample: UInt8[Array, "rows columns 3"],
) -> None:
    """Write pictures as a GIF that repeats itself; all are in memory at the end.

    There are 255 colours, the same in all pictures. Pixels that keep their colour are written
    as transparent, which takes little room.

    Args:
        path: The file.
        pictures: All of one size; at least one.
        per_second: How many of them; hundredths of a second between them are rounded.
        sample: A picture of all colours that matter.
    """
    palette = Image.fromarray(sample).quantize(_SAME, dither=Image.Dither.NONE)

    def quantized(picture: UInt8[Array, "height width 3"]) -> Image.Image:
        """In the colours of the palette."""
        return Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)

    def changes(first: Image.Image) -> Iterator[Image.Image]:
        """What is new in each picture; all else is clear."""
        before = np.asarray(first)
        for picture in pictures:
            now = np.asarray(quantized(picture))
            changed = Image.fromarray(np.where(now == before, np.uint8(_SAME), now))
            changed.putpalette(palette.getpalette() or [])
            before = now
            yield changed

    first = quantized(next(pictures))
    with path.open("wb") as file:
        first.save(
            file, format="GIF", save_all=True, append_images=changes(first), loop=0, disposal=1,
            duration=round(100.0 / per_second) * 10, transparency=_SAME, optimize=False,
        )  # fmt: skip


def write_mp4(
    path: Path, pictures: Iterator[UInt8[Array, "height width 3"]], per_second: float
) -> None:
    """Write pictures as an MP4.

    Args:
        path: The file.
        pictures: All of one size, of even width and height; at least one.
        per_second: How many of them.

    Raises:
        MissingExtra: Nothing here can.
        CannotWrite: The encoder fails.
    """
    check_encoder()
    write = _write_with_command if which(_COMMAND) else _write_with_library
    first = next(pictures)
    write(path, chain([first], pictures), per_second, (first.shape[1], first.shape[0]))


def _write_with_library(
    path: Path,
    pictures: Iterable[UInt8[Array, "height width 3"]],
    per_second: float,
    size: tuple[int, int],
) -> None:
    """As VP9, which browsers play as well: OpenCV's own FFmpeg has no encoder of H.264."""
    import cv2  # noqa: PLC0415 - an extra

    with TemporaryDirectory(dir=path.parent, prefix=".film-") as folder:
        file = Path(folder) / "film.mp4"  # by whose ending it knows what to write
        writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"vp09"), per_second, size)
        if not writer.isOpened():
            raise CannotWrite("OpenCV cannot write an MP4 here; install the command ffmpeg")
        try:
            for picture in pictures:
                writer.write(np.ascontiguousarray(picture[:, :, ::-1]))
        finally:
            writer.release()
        os.replace(file, path)


def _write_with_command(
    path: Path,
    pictures: Iterable[UInt8[Array, "height width 3"]],
    per_second: float,
    size: tuple[int, int],
) -> None:
    command = [
        _COMMAND, "-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo",
        "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", f"{per_second:g}", "-i", "-",
        "-an", "-c:v", *_best_encoder(), "-pix_fmt", "yuv420p", "-movflags", "+faststart",
        "-f", "mp4", f"file:{path}",
    ]  # fmt: skip
    with TemporaryFile() as said:
        encoder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=said, stderr=said)
        assert encoder.stdin is not None
        try:
            with suppress(BrokenPipeError):  # it says why
                for picture in pictures:
                    encoder.stdin.write(picture.tobytes())
        except BaseException:
            encoder.kill()
            raise
        finally:
            with suppress(BrokenPipeError):  # what could not be written is written again
                encoder.stdin.close()
            status = encoder.wait()
        if status != 0:
            said.seek(0)
            words = said.read(2000).decode(errors="replace").strip().replace("\n", "; ")
            raise CannotWrite(f"ffmpeg cannot write the film: {words or f'status {status}'}")


def _best_encoder() -> list[str]:
    """The best that ffmpeg has here, with its settings."""
    listed = subprocess.run(
        [_COMMAND, "-hide_banner", "-encoders"],
        capture_output=True, check=False, timeout=60, stdin=subprocess.DEVNULL,
    ).stdout.decode(errors="replace").split()  # fmt: skip
    for name, settings in _ENCODERS.items():
        if name in listed:
            return [name, *settings]
    raise CannotWrite(f"ffmpeg has none of the encoders {', '.join(_ENCODERS)}; write a .gif")
