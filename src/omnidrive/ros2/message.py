"""ROS 2 messages as Python objects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field as dataclass_field
from dataclasses import fields as dataclass_fields
from dataclasses import make_dataclass
from functools import cache, partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from omnidrive.ros2.interface import LATEST, Distribution, Field, Interface, interface

DTYPES = {"byte": "uint8"}
"""NumPy type of a primitive type whose name is another one."""


class Message:
    """Base class of all messages; the fields of a message are its attributes.

    Numbers, texts and other messages are themselves; several numbers are a NumPy array, several
    texts or messages a list.
    """

    __slots__ = ()
    interface: ClassVar[Interface]
    """Definition of the message."""
    distribution: ClassVar[Distribution]
    """Distribution whose definition it has."""

    if TYPE_CHECKING:

        def __init__(self, *values: Any, **named: Any) -> None: ...
        def __getattr__(self, name: str) -> Any: ...
        def __setattr__(self, name: str, value: Any) -> None: ...

    def __eq__(self, other: object) -> bool:
        """Return whether the other message has the same type and the same values; NaN is NaN."""
        if not isinstance(other, Message) or other.interface != self.interface:
            return NotImplemented
        return all(
            _equal(getattr(self, each.name), getattr(other, each.name))
            for each in self.interface.fields
        )

    __hash__ = None  # type: ignore[assignment]

    def as_dict(self) -> dict[str, Any]:
        """Return the values by field, other messages as dictionaries, arrays as lists."""
        return {each.name: _plain(getattr(self, each.name)) for each in self.interface.fields}


@cache
def message_type(name: str, distribution: Distribution = LATEST) -> type[Message]:
    """Return the class of a message by its full name, such as ``geometry_msgs/msg/Twist``.

    Its constructor takes the fields, by default zeros and empty texts.

    Raises:
        InvalidInput: There is no such interface.
    """
    definition = interface(name, distribution)
    parts = []
    for each in definition.fields:
        default: Any = dataclass_field(default_factory=_default(each, distribution))
        parts.append((each.name, Any, default))
    made = make_dataclass(
        name.rpartition("/")[2],
        parts,
        bases=(Message,),
        slots=True,
        eq=False,
        namespace={"interface": definition, "distribution": distribution},
    )
    assert len(dataclass_fields(made)) == len(definition.fields)
    return made


def _default(field: Field, distribution: Distribution) -> Callable[[], Any]:
    """Return the function that makes the default of a field."""
    if "/" in field.type:
        cls = message_type(field.type, distribution)
        if field.kind == "array":
            return lambda: [cls() for _ in range(field.length)]
        return cls if field.kind == "single" else list
    if field.type == "string":
        if field.kind == "array":
            return lambda: [""] * field.length
        return str if field.kind == "single" else list
    if field.kind == "single":
        value = {"bool": bool, "float32": float, "float64": float}.get(field.type, int)(
            field.default
        )
        return lambda: value
    return partial(np.zeros, field.length if field.kind == "array" else 0, dtype_of(field.type))


def dtype_of(primitive: str) -> np.dtype[Any]:
    """Return the NumPy type of a primitive type, in the byte order of this computer."""
    return np.dtype(DTYPES.get(primitive, primitive))


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return bool(np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True))
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_equal, a, b))
    return bool(a == b or (a != a and b != b))  # noqa: PLR0124 - NaN


def _plain(value: Any) -> Any:
    if isinstance(value, Message):
        return value.as_dict()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [_plain(each) for each in value] if isinstance(value, list) else value
