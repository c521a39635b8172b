"""Limit of the memory that a block allocates."""

import tracemalloc
from contextlib import contextmanager


@contextmanager
def allocates_at_most(limit):
    """Fail if Python holds more than ``limit`` bytes that were allocated in the block."""
    tracemalloc.start()
    try:
        yield
        peak = tracemalloc.get_traced_memory()[1]
        assert peak <= limit, peak
    finally:
        tracemalloc.stop()
