"""Views of arrays in compiled code, without reference counting and bounds checks if possible.

Compiled code increments and decrements the reference count of an array at every call that passes
it, in two atomic operations, and clips the bounds of a slice to its array. With the internals of
Numba (:mod:`omnidrive.compiled.versions`), these functions do neither.

An array without reference counting does not prevent its release: an array that a function creates
is released after the last use of its variable. An argument is not released before the function
returns. Therefore a function may use :func:`uncounted` and views only for its arguments, and must
not return what it gets. The bounds must be within the array.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numba
from numba import errors, types
from numba.extending import intrinsic

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.compiled.versions import USES_INTERNALS

_numba: Any = numba  # Numba's modules are not typed
_carray = _numba.carray
_errors: Any = errors
_types: Any = types
T = TypeVar("T")
A = TypeVar("A", bound=Array)


@intrinsic
def _address_of(_: Any, array: Any, address: Any, begin: Any) -> Any:
    if array.ndim != 1 or array.layout != "C":
        raise _errors.TypingError(f"a view needs a contiguous array of one dimension, got {array}")
    kind = _types.CPointer(array.dtype)

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit the address of an element of the array."""
        _, address, begin = arguments
        pointer = builder.inttoptr(address, context.get_value_type(kind))
        return builder.gep(pointer, [begin])

    return kind(array, address, _types.intp), build


_pointer: Any = _address_of  # its first argument is not passed


@inlined
def uncounted(value: T) -> T:
    """Return an array, or a tuple of arrays, numbers and tuples, without counting."""
    return value


@inlined
def unsafe_slice(array: A, begin: int, end: int) -> A:
    """Return ``array[begin:end]`` of a contiguous vector."""
    view: A = _carray(_pointer(array, array.ctypes.data, begin), (end - begin,))
    return view


@inlined
def unsafe_matrix(array: Array, begin: int, rows: int, columns: int) -> Array:
    """Return part of a contiguous vector as a matrix, row by row."""
    view: Array = _carray(_pointer(array, array.ctypes.data, begin), (rows, columns))
    return view


if USES_INTERNALS:
    from omnidrive.compiled import numba_internals

    _internals: Any = numba_internals
    uncounted = _internals.uncounted
