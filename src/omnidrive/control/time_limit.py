"""Time limit of calls in the main thread."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType

_TICKS = 10


class TimedOut(BaseException):
    """A call was interrupted; no ``Exception``, so that code with ``except Exception`` ends too."""


class TimeLimit:
    """Context manager that raises :class:`TimedOut` in its block after some wall-clock time.

    Python code and waiting calls such as ``time.sleep`` are interrupted; code of another language
    is interrupted when it returns. The time is counted in tenths of the limit, of which a process
    that is stopped (SIGSTOP, a suspended computer) misses all but one: that is no time of the call.
    An exception that the block suppresses is raised again a tenth later.

    Nothing is interrupted in a thread other than the main one, on a system without ``SIGALRM``, if
    the program uses this signal itself, and in a debugger.

    Args:
        seconds: Limit, s.

    Attributes:
        armed: Whether the block is interrupted.
    """

    __slots__ = ("_interval", "_ticks", "armed")

    def __init__(self, seconds: float) -> None:
        self._interval, self._ticks, self.armed = seconds / _TICKS, 0, False

    def __enter__(self) -> TimeLimit:
        self.armed = not _active and _can_interrupt()
        if self.armed:
            _active.append(self)
            signal.setitimer(signal.ITIMER_REAL, self._interval, self._interval)
        return self

    def __exit__(self, *_: object) -> None:
        if self.armed:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            _active.clear()

    def tick(self, frame: FrameType | None) -> None:
        """Count the time; raise TimedOut at the end, except in ``__exit__`` and in a debugger."""
        self._ticks += 1
        leaving = frame is not None and frame.f_code is TimeLimit.__exit__.__code__
        if self._ticks >= _TICKS and not leaving and sys.gettrace() is None:
            raise TimedOut


_active: list[TimeLimit] = []
"""The limit of the block that is executed; empty outside of one."""


def _can_interrupt() -> bool:
    """Return whether blocks of this thread can be interrupted.

    The handler of the signal is set at the first call, and stays: to set and reset it for every
    block takes longer than many blocks.
    """
    if not hasattr(signal, "setitimer"):
        return False
    if threading.current_thread() is not threading.main_thread():
        return False
    handler = signal.getsignal(signal.SIGALRM)
    if handler is signal.SIG_DFL:
        signal.signal(signal.SIGALRM, _on_alarm)
    return handler in {signal.SIG_DFL, _on_alarm}


def _on_alarm(_number: int, frame: FrameType | None) -> None:
    for limit in _active:
        limit.tick(frame)
