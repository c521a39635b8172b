"""Reports of the compilation of kernels, also from worker processes."""

from __future__ import annotations

import gc
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from time import perf_counter
from typing import NamedTuple

from omnidrive.compiled.versions import VERSION_NOTE

_log = logging.getLogger("omnidrive.compiled")

_NOTE = (
    "compiling kernels before their first use; `omnidrive warmup` compiles those of all commands"
)


class Compilation(NamedTuple):
    """Start or end of the compilation of one kernel."""

    kernel: str
    """Name of the kernel."""
    seconds: float | None = None
    """Wall time of the compilation, s; None: it starts."""


compile_listeners: list[Callable[[Compilation], None]] = []
"""Called with each compilation; not if the machine code is on disk."""


def notify(compilation: Compilation) -> None:
    """Call all listeners."""
    for listener in [*compile_listeners]:
        listener(compilation)


@contextmanager
def reported(kernel: str) -> Iterator[None]:
    """Notify the listeners of the start and the end of a compilation; collect no garbage in it.

    Collections take a sixth of the compile time and find little.
    """
    notify(Compilation(kernel))
    began = perf_counter()
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
        notify(Compilation(kernel, perf_counter() - began))


@contextmanager
def announce_compiling(note: str = _NOTE) -> Iterator[None]:
    """Log a note at the first compilation, and the start and the end of each.

    The note is a warning, the others are information; their records have the attribute
    ``compilation``. Within another such context, and in a process with other listeners, nothing is
    logged.

    Args:
        note: Text of the note; empty: none.
    """
    if compile_listeners:
        yield
        return
    pending = [text for text in (VERSION_NOTE, note) if text] if note else []

    def listener(compilation: Compilation) -> None:
        """Log one compilation."""
        while pending:
            _log.warning(pending.pop())
        text = "starts" if compilation.seconds is None else f"took {compilation.seconds:.1f} s"
        _log.info(
            "compilation of %s %s", compilation.kernel, text, extra={"compilation": compilation}
        )

    compile_listeners.append(listener)
    try:
        yield
    finally:
        compile_listeners.remove(listener)


class CompileRelay:
    """Channel by which worker processes report compilations to the process that started them.

    It is an argument of the workers. Reports are dropped if this process does not collect them.
    """

    def __init__(self) -> None:
        self._receiver, self._sender = Pipe(duplex=False)
        if os.name == "posix":
            os.set_blocking(self._sender.fileno(), False)

    def send(self, compilation: Compilation) -> None:
        """Report a compilation; a listener of a worker process."""
        seconds = "" if compilation.seconds is None else f"{compilation.seconds:g}"
        with suppress(OSError, ValueError):  # written at once, because it is short
            self._sender.send_bytes(f"{compilation.kernel}\t{seconds}".encode())

    def forward(self) -> None:
        """Notify the listeners of this process of the reports that have arrived."""
        while self._receiver.poll():
            kernel, _, seconds = self._receiver.recv_bytes().decode().partition("\t")
            notify(Compilation(kernel, float(seconds) if seconds else None))
