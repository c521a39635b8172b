"""Compilation of the numerical kernels."""

from __future__ import annotations

from collections.abc import Callable
from inspect import unwrap
from typing import ParamSpec, TypeVar, cast

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def compiled(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile ``kernel`` to machine code on its first call, and keep the result on disk.

    Run-time type checks that wrap the kernel are taken off: the compiler cannot see through them.
    """
    return cast("Callable[P, R]", njit(cache=True, error_model="numpy")(unwrap(kernel)))
