"""Components with parameters as text: ``[LABEL=]TYPE[,KEY=VALUE...]``."""

from __future__ import annotations

from typing import Any, NamedTuple

import yaml

from omnidrive.errors import InvalidInput, one_line

_MAX_LENGTH = 2000


class Specification(NamedTuple):
    """A component as a user writes it on the command line."""

    label: str
    """Label of the component; without one in the text, derived from the type."""
    type: str
    """Name of the component."""
    values: dict[str, Any]
    """Values of parameters."""


def parse_specification(text: str) -> Specification:
    """Parse ``[LABEL=]TYPE[,KEY=VALUE...]``, such as ``fast=holonomic-nmpc,horizon=8``.

    A dot in a key selects a parameter of a group: ``weights.position=3``. Values are numbers, true,
    false, null or text, as in YAML. The label of ``FILE.py:NAME`` is ``NAME`` by default.

    Raises:
        InvalidInput: The text has another form, or a key occurs twice.
    """
    if len(text) > _MAX_LENGTH:
        raise InvalidInput(f"a component has at most {_MAX_LENGTH} characters")
    head, *pairs = text.split(",")
    label, equals, name = head.rpartition("=")
    name = name.strip()
    if not name or (equals and not label.strip()):
        raise InvalidInput(
            f"'{one_line(text, 60)}' is not of the form [LABEL=]TYPE[,KEY=VALUE...], such as "
            "pid or fast=holonomic-nmpc,horizon=8"
        )
    values: dict[str, Any] = {}
    for pair in pairs:
        key, equals, value = (part.strip() for part in pair.partition("="))
        if not (key and equals):
            raise InvalidInput(f"'{one_line(pair, 60)}' in '{one_line(text, 60)}' is not KEY=VALUE")
        _set(values, key, _scalar(value))
    return Specification(label.strip() or name.rpartition(":")[2], name, values)


def _set(values: dict[str, Any], key: str, value: Any) -> None:
    *groups, name = key.split(".")
    for group in groups:
        values = values.setdefault(group, {})
        if not isinstance(values, dict):
            raise InvalidInput(f"'{one_line(key, 60)}': '{group}' has a value already")
    if name in values:
        raise InvalidInput(f"'{one_line(key, 60)}' occurs twice")
    values[name] = value


def _scalar(text: str) -> Any:
    """Return a number, a truth value, None, or the text itself."""
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        return text
    return value if isinstance(value, int | float | bool | None) else text
