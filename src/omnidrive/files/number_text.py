"""Numbers in text files and options."""

from __future__ import annotations

import re
from math import isfinite

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_MAX_LENGTH = 400  # characters; more than any float needs in decimal notation


def parse_number(text: str) -> float | None:
    """Return the number in ``text``; None for any other text.

    A number is written in decimal digits with an optional sign, point and exponent, such as
    ``-1.5e3``; blanks around it are ignored. Unlike :class:`float`, underscores (``1_000``), digits
    of other scripts, ``inf``, ``nan`` and numbers beyond 1.8e308 are no numbers.
    """
    word = text.strip()
    if len(word) > _MAX_LENGTH or not _NUMBER.fullmatch(word):
        return None
    value = float(word)
    return value if isfinite(value) else None
