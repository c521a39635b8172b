"""Messages for tests: random values, and the same messages of the independent encoder rosbags."""

from functools import cache

import numpy as np
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from omnidrive.ros2 import interfaces, message_type
from omnidrive.ros2.message import dtype_of

STORES = {
    "humble": Stores.ROS2_HUMBLE,
    "iron": Stores.ROS2_IRON,
    "jazzy": Stores.ROS2_JAZZY,
    "kilted": Stores.ROS2_KILTED,
    "lyrical": Stores.ROS2_LYRICAL,
    "rolling": Stores.ROS2_LYRICAL,
}


@cache
def typestore(distribution):
    """Types of rosbags, and those that it lacks: services, actions, and GIDs of bytes."""
    store = get_typestore(STORES[distribution])
    gid = "rmw_dds_common/msg/Gid"  # the interface text has char, of which IDL makes uint8
    del store.fielddefs[gid], store.types[gid]
    missing = {}
    for name, each in interfaces(distribution).items():
        if name not in store.fielddefs:
            text = "\n".join(f"{full_type(f)} {f.name}" for f in each.fields)
            text = text or "uint8 structure_needs_at_least_one_member"
            missing[name] = get_types_from_msg(text, "omnidrive/msg/Type")["omnidrive/msg/Type"]
    store.register(missing)
    return store


def full_type(field):
    """Type text with the full name, which tells a message from a part of an action."""
    return field.type_text.replace("/".join(field.type.split("/")[::2]), field.type)


def to_peer(message, store):
    """Return the message as an object of rosbags."""
    values = {}
    for field in message.interface.fields:
        value = getattr(message, field.name)
        if "/" in field.type:
            value = (
                to_peer(value, store)
                if field.kind == "single"
                else [to_peer(each, store) for each in value]
            )
        values[field.name] = value
    if not values:
        values["structure_needs_at_least_one_member"] = 0
    return store.types[message.interface.name](**values)


def from_peer(value, name, distribution):
    """Return an object of rosbags as a message."""
    cls = message_type(name, distribution)
    values = {}
    for field in cls.interface.fields:
        each = getattr(value, field.name)
        if "/" in field.type:
            each = (
                from_peer(each, field.type, distribution)
                if field.kind == "single"
                else [from_peer(one, field.type, distribution) for one in each]
            )
        values[field.name] = each
    return cls(**values)


def messages(name, distribution="jazzy"):
    """Strategy of messages with random values."""
    cls = message_type(name, distribution)
    fields = {f.name: _values(f, distribution) for f in cls.interface.fields}
    return st.builds(cls, **fields)


def _values(field, distribution):
    if "/" in field.type:
        one = messages(field.type, distribution)
        if field.kind == "single":
            return one
        return st.lists(one, max_size=3)
    if field.type == "string":
        one = st.text(
            st.characters(codec="utf-8", exclude_characters="\0"), max_size=min(field.bound or 9, 9)
        )
        return one if field.kind == "single" else st.lists(one, max_size=3)
    if field.type == "byte":
        return st.integers(0, 127)  # rosbags has signed ones
    dtype = dtype_of(field.type)
    if field.kind == "single":
        return _bits(dtype, 1).map(lambda a: a[0].item())
    size = st.just(field.length) if field.kind == "array" else st.integers(0, 5)
    return size.flatmap(lambda n: _bits(dtype, n))


def _bits(dtype, n):
    """Arrays of any bits, so that NaN, infinities and subnormal numbers are among them."""
    if dtype == np.bool_:
        return st.lists(st.booleans(), min_size=n, max_size=n).map(lambda v: np.array(v, bool))
    return st.binary(min_size=n * dtype.itemsize, max_size=n * dtype.itemsize).map(
        lambda raw: _quiet(np.frombuffer(raw, dtype).copy())
    )


def _quiet(array):
    """Signalling NaN become quiet ones, which survive the conversion to Python's floats."""
    if array.dtype.kind == "f":
        array[np.isnan(array)] = np.nan
    return array
