"""Views of arrays in compiled code without reference counting and without bounds checks.

Compiled code clips the bounds of a slice to its array, and counts the references to it. A view has
the conditions of :mod:`omnidrive.compiled.uncounted`: a function may use views only of arrays that
it receives as arguments.

The nested functions ``build`` emit LLVM code, through internals of Numba.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba.core import types
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from omnidrive.arrays import Array

A = TypeVar("A", bound=Array)

_populate_array: Any = populate_array  # Numba's modules are not typed
_types: Any = types
_Intrinsic = tuple[Any, Callable[..., Any]]


@intrinsic
def _unsafe_slice(_: Any, array: Any, begin: Any, end: Any) -> _Intrinsic:
    _check_contiguous(array)

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit a view of the elements from ``begin`` up to, but not including, ``end``."""
        source, begin, end = arguments
        length = builder.sub(end, begin)
        return _view_in(context, builder, (array, source), begin, (array, [length]))

    return array(array, types.intp, types.intp), build


@intrinsic
def _unsafe_matrix(_: Any, array: Any, begin: Any, rows: Any, columns: Any) -> _Intrinsic:
    _check_contiguous(array)
    kind = types.Array(array.dtype, 2, "C")

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit a view as a matrix whose first element is element ``begin``."""
        source, begin, *shape = arguments
        return _view_in(context, builder, (array, source), begin, (kind, shape))

    return kind(array, types.intp, types.intp, types.intp), build


@intrinsic
def _unsafe_array(_: Any, array: Any, begin: Any, shape: Any) -> _Intrinsic:
    _check_contiguous(array)
    kind = types.Array(array.dtype, len(shape), "C")

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit a view as an array whose first element is element ``begin``."""
        source, begin, shape = arguments
        lengths = [builder.extract_value(shape, k) for k in range(kind.ndim)]
        return _view_in(context, builder, (array, source), begin, (kind, lengths))

    return kind(array, types.intp, _types.UniTuple(types.intp, len(shape))), build


def _check_contiguous(array: Any) -> None:
    if array.ndim != 1 or array.layout != "C":
        raise TypingError(f"a view needs a contiguous array of one dimension, got {array}")


def _view_in(context: Any, builder: Any, source: Any, begin: Any, target: Any) -> Any:
    """Emit a view in C order within a one-dimensional array.

    Args:
        context: Numba's target context.
        builder: LLVM builder.
        source: Type and value of the array.
        begin: Index of the first element of the view.
        target: Type and shape of the view.
    """
    kind, shape = target
    array = context.make_array(source[0])(context, builder, value=source[1])
    strides = [array.itemsize]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(length, strides[0]))
    made = context.make_array(kind)(context, builder)
    data = builder.gep(array.data, [begin])
    _populate_array(made, data, shape, strides, array.itemsize, meminfo=None)
    return made._getvalue()


unsafe_slice = cast("Callable[[A, int, int], A]", _unsafe_slice)
"""``unsafe_slice(array, begin, end)``: ``array[begin:end]`` of a contiguous vector.

The bounds are neither checked nor clipped, and must not be negative."""

unsafe_matrix = cast("Callable[[Array, int, int, int], Array]", _unsafe_matrix)
"""``unsafe_matrix(array, begin, rows, columns)``: part of a contiguous vector as a matrix.

``array[begin : begin + rows * columns]`` row by row. The bounds are not checked."""

unsafe_array = cast("Callable[[Array, int, tuple[int, ...]], Array]", _unsafe_array)
"""``unsafe_array(array, begin, shape)``: part of a contiguous vector as an array in C order."""
