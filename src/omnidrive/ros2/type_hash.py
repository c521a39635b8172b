"""Hashes of ROS 2 interfaces, as nodes announce them from Iron on."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from typing import Any, cast, get_args

from omnidrive.ros2.interface import (
    LATEST,
    Distribution,
    Field,
    interface,
    interfaces,
    referenced,
)

_TYPE_IDS = {
    "int8": 2,
    "uint8": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
_NESTED, _BOUNDED_STRING = 1, 21
_ARRAY, _BOUNDED_SEQUENCE, _SEQUENCE = 48, 96, 144  # added to the number of the element


@cache
def type_hash(name: str, distribution: Distribution = LATEST) -> str:
    """Return the hash ``RIHS01_...`` of an interface.

    It is the SHA-256 of the type description as JSON (REP 2016, ROS Interface Hashing Standard).

    Raises:
        InvalidInput: There is no such interface.
    """
    description = {
        "type_description": _description(name, distribution),
        "referenced_type_descriptions": [
            _description(each, distribution) for each in referenced(name, distribution)
        ],
    }
    return f"RIHS01_{sha256(json.dumps(description).encode()).hexdigest()}"


_DISTRIBUTIONS = cast(tuple[Distribution, ...], get_args(Distribution))


def distributions_with(name: str, hash_text: str) -> tuple[Distribution, ...]:
    """Return the distributions in which an interface has a hash; empty: none that is known."""
    return tuple(
        each
        for each in _DISTRIBUTIONS
        if name in interfaces(each) and type_hash(name, each) == hash_text
    )


def distribution_of(hashes: Iterable[tuple[str, str]]) -> Distribution | None:
    """Return the distribution that fits the most of the announced hashes.

    Of several, it is :data:`LATEST`, or else the oldest one.

    Args:
        hashes: Full names of types, and their hashes; an empty hash is announced by Humble.

    Returns:
        The distribution; None: no hash is given.
    """
    given = set(hashes)
    if not given:
        return None
    if not any(each for _, each in given):
        return "humble"
    order = (LATEST, *(each for each in _DISTRIBUTIONS if each not in {LATEST, "humble"}))
    fits = {each: 0 for each in order}
    for name, hash_text in given:
        for each in distributions_with(name, hash_text):
            if each in fits:
                fits[each] += 1
    return max(order, key=fits.__getitem__)


def _description(name: str, distribution: Distribution) -> dict[str, Any]:
    fields = interface(name, distribution).fields or (NO_FIELDS,)
    return {
        "type_name": name,
        "fields": [{"name": field.name, "type": _field_type(field)} for field in fields],
    }


NO_FIELDS = Field("structure_needs_at_least_one_member", "uint8")
"""What an interface without fields holds, as IDL has no empty structures."""


def _field_type(field: Field) -> dict[str, Any]:
    nested = "/" in field.type
    number = _NESTED if nested else _TYPE_IDS[field.type]
    if field.bound:
        number = _BOUNDED_STRING
    if field.kind == "array":
        number += _ARRAY
    elif field.kind == "sequence":
        number += _BOUNDED_SEQUENCE if field.length else _SEQUENCE
    return {
        "type_id": number,
        "capacity": field.length,
        "string_capacity": field.bound,
        "nested_type_name": field.type if nested else "",
    }
