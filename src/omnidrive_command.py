"""Entry point of the command `omnidrive`, and the signals that end it.

It stands outside the package, whose import takes a second, so that signals are handled during that
import, too. Python locks modules by weak references, and ignores exceptions in their callbacks.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from _thread import start_new_thread
from contextlib import suppress
from importlib import import_module
from threading import main_thread
from time import monotonic, sleep
from types import FrameType
from typing import Any, ClassVar

_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_TWICE = 1.0  # s; `timeout` and systemd send a signal to the process and to its group
_AGAIN = 0.02  # s until an interruption that Python ignored is raised again


class _State:
    """State of the handlers.

    Attributes:
        received: The first signal. None: none.
        since: When it was received, s on the monotonic clock.
        raising: Whether the next signal raises KeyboardInterrupt.
        handlers: Handlers before :func:`install`.
        unraisable: The function that Python calls for exceptions that it ignores.
    """

    received: int | None = None
    since = 0.0
    raising = False
    handlers: ClassVar[dict[int, Any]] = {}
    unraisable: Any = None


def main() -> None:
    """Import the command line, run it, and exit with its status; 128 + n after signal n."""
    status = 128 + signal.SIGINT  # of code that raises KeyboardInterrupt itself
    try:
        install()
        try:
            status = import_module("omnidrive.cli.main").run()
        finally:
            disarm()
    except KeyboardInterrupt:
        pass
    received = restore()
    if received is not None:
        status = 128 + received
        with suppress(OSError):  # the terminal is closed
            print("omnidrive: interrupted; finished results are kept", file=sys.stderr, flush=True)
    gc.freeze()  # otherwise the end of the interpreter searches all objects for garbage
    sys.exit(status)


def install() -> None:
    """Raise KeyboardInterrupt at the first signal; a second one, a second later, ends at once.

    Signals that are ignored, as SIGHUP under nohup, stay ignored.
    """
    _State.received, _State.raising = None, True
    _State.unraisable, sys.unraisablehook = sys.unraisablehook, _raise_again
    for number in _SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            _State.handlers[number] = signal.signal(number, _handle)


def disarm() -> None:
    """Only record further signals: the command is at its end."""
    _State.raising = False


def restore() -> int | None:
    """Restore the handlers before :func:`install`; return the signal that was received.

    Python's own handler of SIGINT is not restored: while the interpreter ends, it would change
    neither the exit status nor the end.
    """
    disarm()
    for number, handler in _State.handlers.items():
        python = handler is signal.default_int_handler
        signal.signal(number, signal.SIG_DFL if python else handler)
    _State.handlers.clear()
    sys.unraisablehook = _State.unraisable
    received, _State.received = _State.received, None
    return received


def check_interrupted() -> None:
    """Raise KeyboardInterrupt if a signal was received, but its exception was caught on the way."""
    if _State.received is not None:
        raise KeyboardInterrupt


def _handle(number: int, _frame: FrameType | None) -> None:
    first = _State.received is None
    if first:
        _State.received, _State.since = number, monotonic()
    if _State.raising:
        _State.raising = False
        raise KeyboardInterrupt
    if not first and monotonic() - _State.since > _TWICE:
        os._exit(128 + (_State.received or number))  # worker processes end with this one


def _raise_again(ignored: Any) -> None:
    """Raise an interruption again that Python ignores, as in the callback of a weak reference."""
    if _State.received is None or not issubclass(ignored.exc_type, KeyboardInterrupt):
        _State.unraisable(ignored)
    else:
        _State.raising = True
        start_new_thread(_send_again, (_State.received,))  # without the locks of `threading`


def _send_again(number: int) -> None:
    """Send a signal to the main thread, unless the command has ended."""
    sleep(_AGAIN)
    if not _State.raising:
        return
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(main_thread().ident or 0, number)
    else:
        signal.raise_signal(number)
