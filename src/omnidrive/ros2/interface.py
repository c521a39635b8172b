"""Definitions of the ROS 2 messages, services and actions that the package uses."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Literal, NamedTuple, get_args

from omnidrive.errors import InvalidInput, one_line, suggestion
from omnidrive.parameter import check_choice

Distribution = Literal["humble", "iron", "jazzy", "kilted", "lyrical", "rolling"]
"""ROS 2 distributions whose definitions are known."""
LATEST: Distribution = "jazzy"
"""Distribution that is assumed unless another one is given or detected."""

PRIMITIVES = {
    "bool": "?", "byte": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""Codes of the primitive types in the formats of :mod:`struct`."""


class Field(NamedTuple):
    """One field of an interface."""

    name: str
    """Name."""
    type: str
    """Name of a primitive type, ``string``, or full name of another interface."""
    kind: Literal["single", "array", "sequence"] = "single"
    """Whether it holds one value, a fixed number of values, or any number of them."""
    length: int = 0
    """Length of an array, greatest length of a sequence (0: not bounded)."""
    bound: int = 0
    """Greatest length of a string, in bytes; 0: not bounded."""
    default: float = 0.0
    """Default of a number."""

    @property
    def type_text(self) -> str:
        """Type in the notation of ``.msg`` files."""
        name = re.sub(r"/(msg|srv|action)/", "/", self.type)
        text = f"{name}<={self.bound}" if self.bound else name
        if self.kind == "single":
            return text
        if self.kind == "array":
            return f"{text}[{self.length}]"
        return f"{text}[<={self.length}]" if self.length else f"{text}[]"


class Interface(NamedTuple):
    """A message, or a request, response, goal, result or feedback."""

    name: str
    """Full name, such as ``nav_msgs/msg/Odometry``."""
    fields: tuple[Field, ...]
    """Fields in the order of transmission."""


_TYPE = re.compile(
    r"(?P<type>[a-z][\w/]*?)(<=(?P<bound>\d+))?(\[(?P<most><=)?(?P<length>\d*)\])?$",
    re.ASCII | re.I,
)


@cache
def interfaces(distribution: Distribution = LATEST) -> Mapping[str, Interface]:
    """Return all interfaces of a distribution by their full names.

    Raises:
        InvalidInput: The distribution is not known.
    """
    check_choice("distribution", distribution, get_args(Distribution))
    found: dict[str, list[Field]] = {}
    fields: list[Field] = []
    text = files("omnidrive.ros2").joinpath("interfaces.txt").read_text(encoding="utf-8")
    for line in text.splitlines():
        if line.startswith("  "):
            fields.append(_field(line))
        elif line and not line.startswith("#"):
            name, _, only = line.partition(" @ ")
            fields = []
            if not only or distribution in only.split():
                found[name] = fields
    return MappingProxyType({k: Interface(k, tuple(v)) for k, v in found.items()})


def interface(name: str, distribution: Distribution = LATEST) -> Interface:
    """Return the interface with a full name, such as ``geometry_msgs/msg/Twist``.

    Raises:
        InvalidInput: There is none.
    """
    known = interfaces(distribution)
    if name not in known:
        raise InvalidInput(f"no ROS 2 interface {one_line(name, 100)}{suggestion(name, known)}")
    return known[name]


def referenced(name: str, distribution: Distribution = LATEST) -> tuple[str, ...]:
    """Return the full names of all interfaces that one contains, directly or not, sorted."""
    seen: set[str] = set()
    open_names = [name]
    while open_names:
        for field in interface(open_names.pop(), distribution).fields:
            if "/" in field.type and field.type not in seen:
                seen.add(field.type)
                open_names.append(field.type)
    return tuple(sorted(seen - {name}))


def definition_text(name: str, distribution: Distribution = LATEST) -> str:
    """Return the definition of an interface with those that it contains, as logs store it.

    The format is ``ros2msg`` of MCAP: the ``.msg`` text, and the other types after separators.
    """
    texts = []
    for each in (name, *referenced(name, distribution)):
        lines = [f"{f.type_text} {f.name}" for f in interface(each, distribution).fields]
        if each != name:
            lines.insert(0, "MSG: " + re.sub(r"/(msg|srv|action)/", "/", each))
        texts.append("\n".join(lines) + "\n")
    return ("=" * 80 + "\n").join(texts)


def _field(line: str) -> Field:
    """Parse one line of the file of definitions."""
    kind_text, name, *default = line.split()
    match = _TYPE.match(kind_text)
    assert match is not None, line
    kind: Literal["single", "array", "sequence"] = "single"
    if match["length"] is not None:
        kind = "sequence" if match["most"] or not match["length"] else "array"
    return Field(
        name,
        match["type"],
        kind,
        int(match["length"] or 0),
        int(match["bound"] or 0),
        float(default[0]) if default else 0.0,
    )
