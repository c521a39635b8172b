"""How property tests draw their examples."""

from hypothesis import settings

# what is checked before a change lands must not depend on luck; `make test-long` seeks new examples
settings.register_profile("repeatable", derandomize=True)
settings.register_profile("fresh", print_blob=True)
