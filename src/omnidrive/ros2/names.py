"""Names of ROS 2 as names of DDS, and back."""

from __future__ import annotations

import re

from omnidrive.errors import InvalidInput, short_repr

_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_PREFIXES = {"rt": "", "rq": "Request", "rr": "Reply"}
"""Prefix of topics, requests and replies, and their suffix."""


def resolve(name: str, namespace: str = "/", *, node: str = "") -> str:
    """Return the absolute name of a topic or service: ``/name``, or below the namespace.

    ``~/name`` is below the name of the node.

    Raises:
        InvalidInput: It is not a name of ROS 2: letters, digits and underscores, no digit first.
    """
    private = name.startswith("~/")
    if not _NAME.fullmatch(name.removeprefix("~/")) or "__" in name or (private and not node):
        raise InvalidInput(
            f"{short_repr(name)} is not a name of ROS 2: letters, digits, single underscores and "
            "slashes, such as /cmd_vel"
        )
    if name.startswith("/"):
        return name
    head = namespace.rstrip("/")
    return f"{head}/{node}/{name.removeprefix('~/')}" if private else f"{head}/{name}"


def dds_topic(name: str, prefix: str = "rt") -> str:
    """Return the DDS topic of an absolute name; the prefix is rt, rq (requests) or rr (replies)."""
    return f"{prefix}{name}{_PREFIXES[prefix]}"


def ros_topic(topic: str) -> tuple[str, str] | None:
    """Return the absolute name and the prefix of a DDS topic; None if it is not of ROS."""
    prefix, slash, _ = topic.partition("/")
    suffix = _PREFIXES.get(prefix)
    if not slash or suffix is None or not topic.endswith(suffix):
        return None
    return topic[len(prefix) : len(topic) - len(suffix)], prefix


def dds_type_name(interface: str) -> str:
    """Return the DDS name of a type: ``geometry_msgs::msg::dds_::Twist_``."""
    package, kind, name = interface.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type_name(type_name: str) -> str:
    """Return the full name of a type by its DDS name, which is returned if it is not of ROS."""
    match = re.fullmatch(r"(\w+)::(\w+)::dds_::(\w+)_", type_name, re.ASCII)
    return "/".join(match.groups()) if match else type_name
