"""Signals that end the command: none is lost, whatever code they interrupt."""

from __future__ import annotations

import os
import signal
import sys
from time import monotonic
from types import FrameType
from typing import Any

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
    handlers: dict[int, Any] = {}  # noqa: RUF012
    unraisable: Any = None


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
    return _State.received


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
    elif hasattr(signal, "setitimer"):
        _State.raising = True
        signal.signal(signal.SIGALRM, _handle)
        signal.setitimer(signal.ITIMER_REAL, _AGAIN)
