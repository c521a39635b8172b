"""Profiles of the property tests."""

from hypothesis import settings

# quick tests use fixed examples; `make test-long` draws new ones, twice as many.
# The first call of a kernel compiles it: no deadline
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=50)
settings.register_profile("fresh", print_blob=True, deadline=None, max_examples=100)
