"""Compilation of the numerical kernels, with every version of Numba.

What depends on Numba's internals is in :mod:`omnidrive.compiled.numba_internals`, and left out with
versions that it is not tested with.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import unwrap
from typing import Any, ParamSpec, TypeVar, cast

from numba import config, typeof
from numba.extending import overload

from omnidrive.compiled.compilation import announce_compiling
from omnidrive.compiled.compiled_function import CompiledFunction
from omnidrive.compiled.public_kernel import make_public_kernel
from omnidrive.compiled.versions import USES_INTERNALS

if USES_INTERNALS:
    from omnidrive.compiled import numba_internals

P = ParamSpec("P")
R = TypeVar("R")

_config: Any = config  # its attributes are set at run time
_overload: Any = overload
_OPTIONS = {"error_model": "numpy", "nogil": True}
_CALLEE_OPTIONS = _OPTIONS | (numba_internals.NO_WRAPPERS if USES_INTERNALS else {})

__all__ = [
    "CompiledFunction",
    "announce_compiling",
    "compilable",
    "compilable_as",
    "compiled",
    "compiled_sums",
    "entry_point",
    "inlined",
    "kernels",
]

kernels: list[Any] = []
"""All kernels whose modules are imported."""


def compiled(kernel: Callable[P, R]) -> Callable[P, R]:
    """Compile ``kernel`` to machine code on its first call and cache the machine code on disk.

    A cache entry is valid until code changes that the kernel can reach, see
    :mod:`omnidrive.compiled.key`. A kernel releases the interpreter's lock, so that threads run in
    parallel. Run-time type checks that wrap the kernel are removed, because Numba cannot compile
    them.
    """
    return _compiled(kernel)


def compiled_sums(kernel: Callable[P, R]) -> Callable[P, R]:
    """As :func:`compiled`, for sums whose terms may be added in any order (SIMD).

    The order, and with it the last digit of the sum, depends on the processor only.
    """
    return _compiled(kernel, fastmath={"reassoc"})


def inlined(kernel: Callable[P, R]) -> Callable[P, R]:
    """As :func:`compiled`, for a small kernel that is inlined into its callers.

    Passing a dozen arrays to a kernel that is not inlined takes longer than a short loop.
    """
    return _compiled(kernel, forceinline=True)


def compilable(function: Callable[P, R], **options: Any) -> Callable[P, R]:
    """Let kernels call a function that Python executes as before; return the function.

    For a law that is called once per sample from Python, and from compiled loops: one text, no
    compilation for Python, and the same bits in both, except that a kernel computes ``x**2`` as
    ``x * x``. The function refers only to what a kernel may refer to.
    """
    plain = unwrap(function)
    _overload(function, strict=False, jit_options={**_CALLEE_OPTIONS, **options})(
        lambda *_, **__: plain
    )
    return function


def compilable_as(kernel: Callable[P, R]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let kernels call ``kernel`` where Python calls the decorated function.

    For an argument that is an object in Python, and arrays in a kernel.
    """

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        """Return the function, which kernels replace."""
        replaced: Any = function
        replaced.__wrapped__ = unwrap(kernel)  # what Numba compiles, and the key covers
        return compilable(function, forceinline=True)

    return decorated


def _compiled(kernel: Callable[P, R], **options: Any) -> Callable[P, R]:
    function = unwrap(kernel)
    if _config.DISABLE_JIT:
        return cast("Callable[P, R]", function)
    make = numba_internals.Kernel if USES_INTERNALS else make_public_kernel
    machine: Any = make(function, targetoptions={**_OPTIONS, **options})
    kernels.append(machine)
    return cast("Callable[P, R]", machine)


def entry_point(kernel: Callable[P, R], *examples: P.args, **_: P.kwargs) -> Callable[P, R]:
    """Return the machine code of a kernel for the types of the examples, as a function.

    With the internals of Numba, a call skips the dispatch on the types of the arguments; arguments
    of other types are converted, or raise TypeError. Without them, it is a call of the kernel.
    """
    machine: Any = kernel
    types = tuple(map(typeof, examples))
    machine.compile(types)
    if not USES_INTERNALS:
        return kernel
    return cast("Callable[P, R]", machine.overloads[types].entry_point)
