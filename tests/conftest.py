"""Profiles of the property tests."""

from hypothesis import settings

# quick tests use fixed examples; `make test-long` draws new ones
settings.register_profile("repeatable", derandomize=True)
settings.register_profile("fresh", print_blob=True)
