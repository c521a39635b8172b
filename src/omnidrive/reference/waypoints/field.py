"""Values of nested mappings and lists in a file, with their position for error messages."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnidrive.errors import InvalidReference, one_line, short_repr, suggestion
from omnidrive.reference.sampled_reference import MAX_SAMPLES, MAX_VALUE
from omnidrive.reference.waypoints.text_file import read_text


@dataclass(frozen=True, slots=True)
class Field:
    """A value read from a file.

    Attributes:
        value: Mapping, list, string, number, boolean or None.
        name: Position in the file, such as ``poses[3].pose``; empty for the whole file.
        file: Name of the file, for messages.
    """

    value: Any
    name: str
    file: str

    def __getitem__(self, key: str) -> Field:
        """Return the field ``key``; raise InvalidReference if there is none."""
        found = self.get(key)
        if found is None:
            raise self.error(f"has no key '{key}'")
        return found

    def get(self, key: str) -> Field | None:
        """Return the field ``key`` of a mapping, or None if it is absent or null."""
        if not isinstance(self.value, dict):
            raise self.error(f"is {self.description}, need a mapping")
        value = self.value.get(key)
        name = f"{self.name}.{key}" if self.name else key
        return None if value is None else Field(value, name, self.file)

    def only(self, *keys: str) -> Field:
        """Return this mapping; raise InvalidReference if it has other keys than these."""
        for key in self.value if isinstance(self.value, dict) else ():
            if key not in keys:
                raise self.error(
                    f"has the unknown key {short_repr(key)}{suggestion(str(key), keys)}"
                )
        return self

    def items(self) -> list[Field]:
        """Return the fields of a list of at most 100,000 entries."""
        if not isinstance(self.value, list):
            raise self.error(f"is {self.description}, need a list")
        if len(self.value) > MAX_SAMPLES:
            raise self.error(f"has {len(self.value):,} entries, more than {MAX_SAMPLES:,}")
        return [Field(v, f"{self.name}[{i}]", self.file) for i, v in enumerate(self.value)]

    def number(self) -> float:
        """Return the value as a finite number of at most 1e10 in magnitude."""
        value = self.value
        if not isinstance(value, (int, float)) or isinstance(value, bool):
            raise self.error(f"is {self.description}, need a number")
        if not -MAX_VALUE <= value <= MAX_VALUE:  # NaN as well
            raise self.error(
                f"is {self.description}, need a finite number of at most {MAX_VALUE:g} in magnitude"
            )
        return float(value)

    @property
    def description(self) -> str:
        """Short description of the value, for messages."""
        if isinstance(self.value, dict):
            return "a mapping"
        return "a list" if isinstance(self.value, list) else short_repr(self.value)

    def error(self, fact: str) -> InvalidReference:
        """Return an error with the position of this field and the given fact."""
        return InvalidReference(f"{self.file}: {self.name or 'the file'} {fact}")


def read_json(file: Path) -> Field:
    """Read the JSON value in ``file``.

    Raises:
        InvalidReference: The file is not JSON, contains NaN, infinity or a duplicate key, is larger
            than 10 MB, or is nested too deeply.
    """
    text, name = read_text(file), one_line(str(file))
    try:
        value = json.loads(text, object_pairs_hook=_mapping, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise InvalidReference(
            f"{name}, line {error.lineno}: not JSON: {error.msg}; is the file truncated?"
        ) from None
    except RecursionError:
        raise InvalidReference(f"{name} cannot be read: it is nested too deeply") from None
    except ValueError as error:
        raise InvalidReference(f"{name} cannot be read: {one_line(str(error), 120)}") from None
    return Field(value, "", name)


def _mapping(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    mapping = dict(pairs)
    if len(mapping) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise ValueError(f"the key {short_repr(key)} occurs twice in one object")
            seen.add(key)
    return mapping


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number in JSON")
