"""Channels that are not to block a loop."""

from __future__ import annotations

import select
from typing import Any


def is_writable(channel: Any) -> bool:
    """Return whether a socket, pipe or serial line takes a short message at once.

    True if the system cannot tell, as for anything but sockets on Windows, or if it is closed.
    """
    try:
        return bool(select.select([], [channel], [], 0.0)[1])
    except (OSError, TypeError, ValueError):
        return True
