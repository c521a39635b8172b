"""Check that a method of a user's part takes the arguments of its calls, before any call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import signature
from typing import Any


def call_fault(method: Callable[..., Any], arguments: Sequence[str], *, unbound: bool) -> str:
    """Return why a method cannot be called with positional arguments; empty if it can.

    Args:
        method: The method.
        arguments: Names of the arguments, without ``self``.
        unbound: Whether it is the function in the class, which takes ``self``, too.
    """
    try:
        found = signature(method)
    except (TypeError, ValueError):  # it has none, as some that are written in C
        return ""
    own = ("self", *arguments)
    try:
        found.bind(*(own if unbound else arguments))
    except TypeError:
        name = getattr(method, "__name__", "method")
        return (
            f"{name}{found} cannot be called as {name}({', '.join(arguments)}): define it as "
            f"def {name}({', '.join(own)})"
        )
    return ""
