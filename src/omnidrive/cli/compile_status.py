"""Display of the kernel that is being compiled, on a terminal."""

from __future__ import annotations

import logging
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress

from omnidrive.cli.terminal import is_quiet


def _write(text: str) -> None:
    """Replace the present line of standard error."""
    width = shutil.get_terminal_size().columns - 1
    with suppress(OSError):  # the terminal is closed
        sys.stderr.write(f"\r{text[:width]:<{width}}\r{text[:width]}")
        sys.stderr.flush()


displays: list[Callable[[str], None]] = [_write]
"""Functions that show a text until the next one; the last is used."""


class CompileStatus(logging.Handler):
    """Shows which kernel is compiled, the latest of several; the text disappears afterwards."""

    def __init__(self) -> None:
        super().__init__()
        self._count = 0
        self._texts: dict[str, str] = {}  # by kernel that is being compiled

    def emit(self, record: logging.LogRecord) -> None:
        """Show the start or the end of a compilation; ignore other records."""
        compilation = getattr(record, "compilation", None)
        if compilation is None or is_quiet():
            return
        kernel = compilation.kernel
        if compilation.seconds is None:
            self._count += 1
            function = kernel.rpartition(".")[2]
            self._texts[kernel] = f"compiling kernel {self._count}: {function}"
        else:
            self._texts.pop(kernel, None)
        displays[-1](next(reversed(self._texts.values()), ""))


def show_compiling() -> None:
    """Show compilations if standard error is a terminal."""
    if sys.stderr.isatty():
        logger = logging.getLogger("omnidrive.compiled")
        logger.setLevel(logging.INFO)
        logger.addHandler(CompileStatus())
