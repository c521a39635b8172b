"""Profiles of the property tests."""

import gc

import pytest
from hypothesis import HealthCheck, settings

# quick tests use fixed examples; `make test-long` draws new ones, twice as many.
# The first call of a kernel compiles it: no deadline. A busy machine draws examples slowly
EVERY = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("repeatable", derandomize=True, max_examples=50, **EVERY)
settings.register_profile("fresh", print_blob=True, max_examples=100, **EVERY)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect the tests without collecting garbage, which takes a fifth of that time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()  # what is imported stays
        gc.set_threshold(100_000)  # after 700 objects: a third of the time of some tests
        gc.enable()
