"""Views of arrays in compiled code without reference counting and without bounds checks.

Compiled code increments and decrements the reference count of an array at every call that
passes it, in two atomic operations, and a slice is also checked against its array. Both took
half of the time of an inference. The function that creates such a view must keep the array
itself alive until the last use of the view: the caller keeps an argument alive, but an array
created within a function lives only as long as a variable of that function refers to it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from omnidrive.arrays import Array

A = TypeVar("A", bound=Array)

_build: Any = cgutils  # numba's modules are not typed
_fill: Any = populate_array
_Intrinsic = tuple[Any, Callable[..., Any]]


@intrinsic
def _uncounted(_: Any, array: Any) -> _Intrinsic:
    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit a copy of the array's descriptor without owner."""
        made = context.make_array(array)(context, builder, value=arguments[0])
        made.meminfo = _build.get_null_value(made.meminfo.type)
        made.parent = _build.get_null_value(made.parent.type)
        return made._getvalue()

    return array(array), build


@intrinsic
def _unsafe_slice(_: Any, array: Any, begin: Any, end: Any) -> _Intrinsic:
    _check_contiguous(array)

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit a view from ``begin`` to ``end``."""
        source, begin, end = arguments
        length = builder.sub(end, begin)
        return _view_in(context, builder, (array, source), begin, (array, [length]))

    return array(array, types.intp, types.intp), build


@intrinsic
def _unsafe_matrix(_: Any, array: Any, begin: Any, rows: Any, columns: Any) -> _Intrinsic:
    _check_contiguous(array)
    kind = types.Array(array.dtype, 2, "C")

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit a matrix view that starts at ``begin``."""
        source, begin, *shape = arguments
        return _view_in(context, builder, (array, source), begin, (kind, shape))

    return kind(array, types.intp, types.intp, types.intp), build


def _check_contiguous(array: Any) -> None:
    if array.ndim != 1 or array.layout != "C":
        raise TypingError(f"needs a contiguous array of one dimension, got {array}")


def _view_in(context: Any, builder: Any, source: Any, begin: Any, target: Any) -> Any:
    """Emit a view within another array; source and target are pairs of type and value or shape."""
    kind, shape = target
    array = context.make_array(source[0])(context, builder, value=source[1])
    strides = [array.itemsize]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(length, strides[0]))
    made = context.make_array(kind)(context, builder)
    data = builder.gep(array.data, [begin])
    _fill(made, data, shape, strides, array.itemsize, meminfo=None)
    return made._getvalue()


uncounted = cast("Callable[[A], A]", _uncounted)
"""``uncounted(array)``: the same array without reference counting."""

unsafe_slice = cast("Callable[[A, int, int], A]", _unsafe_slice)
"""``unsafe_slice(array, begin, end)``: elements ``begin`` to ``end`` of a contiguous vector.

Not checked against the length of the vector."""

unsafe_matrix = cast("Callable[[Array, int, int, int], Array]", _unsafe_matrix)
"""``unsafe_matrix(array, begin, rows, columns)``: a matrix within a contiguous vector.

It starts at element ``begin``. Not checked against the length of the vector."""
