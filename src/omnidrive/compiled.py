"""Compilation of the numerical kernels."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from inspect import unwrap
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from numba import njit, typeof
from numba.core import config as numba_config

P = ParamSpec("P")
R = TypeVar("R")

_log = logging.getLogger("omnidrive")
_config: Any = numba_config  # its attributes are made at run time


def compiled(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile ``kernel`` to machine code on its first call, and keep the result on disk.

    Numba renews a kept result when the kernel's own file changes, but not when a kernel that it
    calls does. So each state of the package's sources keeps its results apart.

    A kernel runs without the interpreter's lock, so that threads can share the work.

    Run-time type checks that wrap the kernel are taken off: the compiler cannot see through them.
    """
    return _compiled(kernel)


def compiled_sums(kernel: Callable[P, R]) -> Callable[P, R]:
    """As :func:`compiled`, for sums whose terms may be added in any order: several at once.

    The order, and with it the last digit, depends on the processor, but not on anything else.
    """
    return _compiled(kernel, fastmath={"reassoc"})


def inlined(kernel: Callable[P, R]) -> Callable[P, R]:
    """As :func:`compiled`, for a small part of other kernels: they take it in whole.

    A call costs two atomic operations for every array that it hands over, also inside a tuple:
    for a dozen arrays, more than a loop over a few stages does.
    """
    return _compiled(kernel, forceinline=True)


def _compiled(kernel: Callable[P, R], **options: Any) -> Callable[P, R]:
    plain = unwrap(kernel)
    before = _config.CACHE_DIR
    _config.CACHE_DIR = str(_cache_folder(before))
    try:
        machine = njit(cache=True, error_model="numpy", nogil=True, **options)(plain)
    except RuntimeError:  # nowhere to write: compile in every process
        machine = njit(error_model="numpy", nogil=True, **options)(plain)
    finally:
        _config.CACHE_DIR = before
    return cast("Callable[P, R]", machine)


def entry_point(kernel: Callable[P, R], *examples: P.args, **_: P.kwargs) -> Callable[P, R]:
    """A compiled kernel for arguments of exactly the types of the examples, called directly.

    It does without the look at every argument by which a kernel chooses its machine code; other
    types are refused or converted.
    """
    machine: Any = kernel
    types = tuple(map(typeof, examples))
    machine.compile(types)
    return cast("Callable[P, R]", machine.overloads[types].entry_point)


def kernels_are_kept(name: str = "*") -> bool:
    """Whether a kernel, or any, was compiled before, so that nobody has to wait for it again."""
    return any(_cache_folder(_config.CACHE_DIR).rglob(f"*.{name}-*.nbc"))


def announce_compiling(name: str) -> None:
    """Log a warning if a kernel will first have to be compiled, and how to do that beforehand."""
    if not kernels_are_kept(name):
        _log.warning(
            "compiling numerical kernels, the first time only: up to a minute; "
            "`omnidrive warmup` does it beforehand"
        )


@cache
def _cache_folder(users: str) -> Path:
    """Folder for this state of the sources, in the user's choice of cache or beside the package."""
    package = Path(__file__).parent
    digest = sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.read_bytes())
    beside = package / "__pycache__"
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "omnidrive"
    root = Path(users) if users else beside if os.access(package, os.W_OK) else home
    return root / f"kernels-{digest.hexdigest()[:16]}"
