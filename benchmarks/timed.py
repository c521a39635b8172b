"""Calls timed one by one, alike in this process and in the peers'; needs nothing installed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import perf_counter
from typing import Any


def timed(call: Callable[..., Any], arguments: Iterable[tuple]) -> tuple[list[float], list]:
    """Seconds and results of ``call(*each)`` for each of the arguments, in their order."""
    seconds, results = [], []
    for each in arguments:
        began = perf_counter()
        result = call(*each)
        seconds.append(perf_counter() - began)
        results.append(result)
    return seconds, results
