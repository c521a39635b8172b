"""Timing of single calls, for the benchmarks and the peers' services; standard library only."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import perf_counter
from typing import Any


def time_calls(call: Callable[..., Any], arguments: Iterable[tuple]) -> tuple[list[float], list]:
    """Return the seconds and results of ``call(*each)`` for each of the arguments, in order."""
    seconds, results = [], []
    for each in arguments:
        began = perf_counter()
        result = call(*each)
        seconds.append(perf_counter() - began)
        results.append(result)
    return seconds, results
