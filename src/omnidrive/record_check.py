"""Checks of numbers, and of the records that users' parts return."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, cast

import numpy as np

from omnidrive.errors import kind_of

Rule = tuple[Callable[[Any], bool], str]
"""A condition on the value of a field, and what is needed instead of another value."""


def record_fault(record: object, cls: type, rules: Mapping[str, Rule]) -> str | None:
    """Return what is wrong with the result of a part, in one line; None: nothing.

    Args:
        record: What the part returned.
        cls: Class that it must have.
        rules: Rule of each field to check, in this order.
    """
    if not isinstance(record, cls):
        return f"it returned {kind_of(record)}, not a {cls.__name__}"
    for name, (holds, need) in rules.items():
        value = getattr(record, name)
        if not holds(value):
            return f"{name} of its {cls.__name__} is {_shown(value)}, need {need}"
    return None


def are_numbers(values: object) -> bool:
    """Return whether ``values`` is a tuple of real numbers; NaN and infinity are among these."""
    return isinstance(values, tuple) and all(map(is_number, values))


def are_finite(values: object) -> bool:
    """Return whether ``values`` is a tuple of finite real numbers."""
    return are_numbers(values) and all(map(isfinite, cast(tuple[float, ...], values)))


def is_number(value: Any) -> bool:
    """Return whether ``value`` is a real number that a float can hold."""
    return isinstance(value, float | np.floating) or (
        isinstance(value, int | np.integer) and bool(-(2**1000) < value < 2**1000)
    )


def is_count(value: Any) -> bool:
    """Return whether ``value`` is a whole number from 0 to 2^31 - 1."""
    return isinstance(value, int | np.integer) and bool(0 <= value < 2**31)


def _shown(value: object) -> str:
    """Return the beginning of the representation of a value, or its type if it has none."""
    try:
        first, *_ = repr(value).splitlines() or [""]
    except Exception:
        return kind_of(value)
    return first if len(first) <= 60 else f"{first[:57]}..."
