"""The number of examples of property tests."""

from hypothesis import HealthCheck, settings


def examples(count: int, suppress: tuple[HealthCheck, ...] = ()) -> settings:
    """Return the settings of a property test with ``count`` examples, new ones in each run.

    The quick tests take a quarter, the same ones in each run: see the profiles in conftest.py.
    """
    if settings.get_current_profile_name() != "fresh":
        count = (count + 3) // 4
    return settings(max_examples=count, suppress_health_check=suppress)
