"""Arrays in compiled code without reference counting.

Compiled code increments and decrements the reference count of an array at every call that passes
it, in two atomic operations. These took half of the time of a fuzzy inference, and a third of that
of a step of the NMPC.

An array without reference counting does not prevent its release: an array that a function creates
is released after the last use of its variable. An argument is not released before the function
returns. Therefore a function may use :func:`uncounted` only for its arguments, and must not return
what it gets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba.core import cgutils, types
from numba.extending import intrinsic

T = TypeVar("T")

_cgutils: Any = cgutils  # Numba's modules are not typed
_types: Any = types


@intrinsic
def _uncounted(_: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit a copy of the value whose arrays refer to no reference count and no parent."""
        return _without_counts(context, builder, value, arguments[0])

    return value(value), build


def _without_counts(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, _types.Array):
        made = context.make_array(kind)(context, builder, value=value)
        made.meminfo = _cgutils.get_null_value(made.meminfo.type)
        made.parent = _cgutils.get_null_value(made.parent.type)
        return made._getvalue()
    if isinstance(kind, _types.BaseTuple):
        parts = [
            _without_counts(context, builder, part, builder.extract_value(value, i))
            for i, part in enumerate(kind.types)
        ]
        return context.make_tuple(builder, kind, parts)
    return value


uncounted = cast("Callable[[T], T]", _uncounted)
"""``uncounted(value)``: an array, or a tuple of arrays, numbers and tuples, without counting."""
