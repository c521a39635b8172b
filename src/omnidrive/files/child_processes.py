"""Start of Python processes that import nothing from the working folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

SAFE_PATH = {"PYTHONSAFEPATH": "1"}
"""Environment of a Python process that does not search the working folder for modules.

Otherwise ``python -c`` and ``python -m``, by which Python starts processes, prefer a
``threading.py`` that lies there to that of the standard library.
"""


@contextmanager
def safe_path() -> Iterator[None]:
    """Start Python processes in the block with :data:`SAFE_PATH`."""
    before = {name: os.environ.get(name) for name in SAFE_PATH}
    os.environ.update(SAFE_PATH)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
