"""Views of arrays for compiled code, whose uses are not counted.

Each time that compiled code hands over an array it counts one more use, and one less afterwards, in
two atomic steps; a slice is also fitted to its array. That took half of the time of an inference.
Whoever makes a view of these keeps the array itself until the view's last use: an argument is kept
by the caller, but an array made within a function only as long as that function names it.
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

_build: Any = cgutils  # neither has types
_fill: Any = populate_array
_Built = tuple[Any, Callable[..., Any]]


@intrinsic
def _borrowed(_: Any, array: Any) -> _Built:
    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """The array without a count of who holds it."""
        made = context.make_array(array)(context, builder, value=arguments[0])
        made.meminfo = _build.get_null_value(made.meminfo.type)
        made.parent = _build.get_null_value(made.parent.type)
        return made._getvalue()

    return array(array), build


@intrinsic
def _part(_: Any, array: Any, begin: Any, end: Any) -> _Built:
    _check_contiguous(array)

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """From ``begin`` to ``end``."""
        source, begin, end = arguments
        length = builder.sub(end, begin)
        return _within(context, builder, (array, source), begin, (array, [length]))

    return array(array, types.intp, types.intp), build


@intrinsic
def _table(_: Any, array: Any, begin: Any, rows: Any, columns: Any) -> _Built:
    _check_contiguous(array)
    kind = types.Array(array.dtype, 2, "C")

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Rows and columns from ``begin`` on."""
        source, begin, *shape = arguments
        return _within(context, builder, (array, source), begin, (kind, shape))

    return kind(array, types.intp, types.intp, types.intp), build


def _check_contiguous(array: Any) -> None:
    if array.ndim != 1 or array.layout != "C":
        raise TypingError(f"needs a contiguous array of one dimension, got {array}")


def _within(context: Any, builder: Any, source: Any, begin: Any, wanted: Any) -> Any:
    """Array of the wanted type and shape that begins within another: source and wanted are both."""
    kind, shape = wanted
    array = context.make_array(source[0])(context, builder, value=source[1])
    strides = [array.itemsize]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(length, strides[0]))
    made = context.make_array(kind)(context, builder)
    data = builder.gep(array.data, [begin])
    _fill(made, data, shape, strides, array.itemsize, meminfo=None)
    return made._getvalue()


borrowed = cast("Callable[[A], A]", _borrowed)
"""``borrowed(array)``: the same array."""

part = cast("Callable[[A, int, int], A]", _part)
"""``part(array, begin, end)``: elements of a contiguous array of one dimension from ``begin`` up to
``end``. It is not looked at whether it has them."""

table = cast("Callable[[Array, int, int, int], Array]", _table)
"""``table(array, begin, rows, columns)``: a table in a contiguous array of one dimension, from
``begin`` on. It is not looked at whether the array is long enough."""
