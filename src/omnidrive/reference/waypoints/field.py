"""One value inside a file of nested mappings and lists, which knows where it stands."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnidrive.errors import InvalidReference, suggestion
from omnidrive.files.bounded_file import one_line, short_repr
from omnidrive.reference.sampled_reference import MAX_SAMPLES, MAX_VALUE
from omnidrive.reference.waypoints.text_file import read_text


@dataclass(frozen=True, slots=True)
class Field:
    """A value read from a file.

    Attributes:
        value: Mapping, list, text, number, truth value or None.
        name: Where it stands, as ``poses[3].pose``; empty for the whole file.
        file: The file's name, for messages.
    """

    value: Any
    name: str
    file: str

    def __getitem__(self, key: str) -> Field:
        """The field ``key`` of a mapping; refused if this is none or does not have it."""
        found = self.get(key)
        if found is None:
            raise self.error(f"does not set '{key}'")
        return found

    def get(self, key: str) -> Field | None:
        """The field ``key`` of a mapping; None if it is absent or null."""
        if not isinstance(self.value, dict):
            raise self.error(f"is {self.description}, need a mapping")
        value = self.value.get(key)
        name = f"{self.name}.{key}" if self.name else key
        return None if value is None else Field(value, name, self.file)

    def only(self, *keys: str) -> Field:
        """This mapping, refused if it has other keys than these."""
        for key in self.value if isinstance(self.value, dict) else ():
            if key not in keys:
                raise self.error(
                    f"has the unknown key {short_repr(key)}{suggestion(str(key), keys)}"
                )
        return self

    def items(self) -> list[Field]:
        """The fields of a list; no more than 100,000."""
        if not isinstance(self.value, list):
            raise self.error(f"is {self.description}, need a list")
        if len(self.value) > MAX_SAMPLES:
            raise self.error(f"has {len(self.value):,} entries, more than {MAX_SAMPLES:,}")
        return [Field(v, f"{self.name}[{i}]", self.file) for i, v in enumerate(self.value)]

    def number(self) -> float:
        """The value as a finite number of at most 1e10."""
        value = self.value
        if not isinstance(value, (int, float)) or isinstance(value, bool):
            raise self.error(f"is {self.description}, need a number")
        if not -MAX_VALUE <= value <= MAX_VALUE:  # also catches NaN
            raise self.error(
                f"is {self.description}, need a finite number of at most {MAX_VALUE:g}"
            )
        return float(value)

    @property
    def description(self) -> str:
        """The value in a few words, for messages."""
        if isinstance(self.value, dict):
            return "a mapping"
        return "a list" if isinstance(self.value, list) else short_repr(self.value)

    def error(self, fact: str) -> InvalidReference:
        """An error that says where, and what is wrong there."""
        return InvalidReference(f"{self.file}: {self.name or 'the file'} {fact}")


def read_json(file: Path) -> Field:
    """The JSON value in ``file``: without NaN, infinity or keys that stand twice.

    Raises:
        InvalidReference: It is something else, larger than 10 MB or nested too deeply.
    """
    text, name = read_text(file), one_line(str(file))
    try:
        value = json.loads(text, object_pairs_hook=_mapping, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise InvalidReference(
            f"{name}, line {error.lineno}: not JSON: {error.msg}; is the file cut off?"
        ) from None
    except RecursionError:
        raise InvalidReference(f"{name} is not read: it is nested too deeply") from None
    except ValueError as error:
        raise InvalidReference(f"{name} is not read: {one_line(str(error), 120)}") from None
    return Field(value, "", name)


def _mapping(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    mapping = dict(pairs)
    if len(mapping) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise ValueError(f"the key {short_repr(key)} stands twice in one object")
            seen.add(key)
    return mapping


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number that JSON allows")
