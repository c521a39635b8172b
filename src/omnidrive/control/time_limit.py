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
        self.armed = (
            hasattr(signal, "setitimer")
            and threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
        )
        if self.armed:
            signal.signal(signal.SIGALRM, self._tick)
            signal.setitimer(signal.ITIMER_REAL, self._interval, self._interval)
        return self

    def __exit__(self, *_: object) -> None:
        if self.armed:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)

    def _tick(self, _number: int, frame: FrameType | None) -> None:
        """Count the time; raise TimedOut at the end, except in ``__exit__`` and in a debugger."""
        self._ticks += 1
        leaving = frame is not None and frame.f_code is TimeLimit.__exit__.__code__
        if self._ticks >= _TICKS and not leaving and sys.gettrace() is None:
            raise TimedOut
