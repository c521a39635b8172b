"""Messages while nothing finishes."""

from __future__ import annotations

import logging
from threading import Event, Thread
from time import monotonic

_FIRST = 60.0  # s without a finished run before the first message; doubles with each message
_MAX_NAMES = 4  # in a message

_log = logging.getLogger("omnidrive")


class Heartbeat:
    """Context in which a message names what is executed, if nothing finishes for a minute."""

    def __init__(self, first: float = _FIRST) -> None:
        """Prepare the messages; ``first`` is the time before the first one, s."""
        self._first = first
        self._running: dict[str, float] = {}
        self._quiet_since = monotonic()
        self._ended = Event()
        self._thread = Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Heartbeat:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def begin(self, name: str) -> None:
        """Note the start of a run."""
        self._running[name] = monotonic()

    def end(self, name: str) -> None:
        """Note the end of a run."""
        self._running.pop(name, None)
        self._quiet_since = monotonic()

    def _watch(self) -> None:
        """Log messages until the context ends."""
        since, patience = self._quiet_since, self._first
        while not self._ended.wait(0.1 * self._first):
            if self._quiet_since != since:
                since, patience = self._quiet_since, self._first
            if monotonic() - since >= patience:
                patience *= 2.0
                _log.warning(
                    "nothing has finished for %.0f s; %s", monotonic() - since, self._text()
                )

    def _text(self) -> str:
        """Return which runs are executed, and for how long."""
        now = monotonic()
        runs = [f"{name} ({now - begun:.0f} s)" for name, begun in [*self._running.items()]]
        more = f" and {len(runs) - _MAX_NAMES} more" if len(runs) > _MAX_NAMES else ""
        shown = ", ".join(runs[:_MAX_NAMES]) + more
        return f"running: {shown}" if runs else "worker processes are starting"
