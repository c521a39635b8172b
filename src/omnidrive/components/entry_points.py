"""Names of the installed components, known without importing their code.

A distribution declares its components as entry points in groups such as ``omnidrive.controllers``,
as plugins of pytest and environments of Gymnasium do. The components of this package are declared
in the same way, or are a file each in a folder of their group.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Literal, NamedTuple, Protocol, get_args, runtime_checkable

from omnidrive.errors import InvalidInput, suggestion

Group = Literal["controllers", "plants", "robots", "maps", "estimators", "references", "links"]
GROUPS: tuple[Group, ...] = get_args(Group)
"""Groups of components; the entry points of a group are those of ``omnidrive.GROUP``."""

_OWN = "omnidrive"
_PACKAGE = Path(__file__).parents[1]
_FOLDERS: Mapping[str, str] = {"controllers": "control/laws"}
"""Folder of this package by group: each of its modules is a component, see :class:`_Module`."""


@runtime_checkable
class EntryPoint(Protocol):
    """An entry point of importlib.metadata.

    Once some package imports importlib_metadata, as Dask does, it is one of that package.
    """

    @property
    def name(self) -> str:
        """Name of the component."""
        ...

    @property
    def value(self) -> str:
        """Where its code is, as ``module:name``."""
        ...

    @property
    def dist(self) -> Any:
        """Distribution that declares it, or None."""
        ...

    def load(self) -> Any:
        """Import the code."""
        ...


class _Module(NamedTuple):
    """The :class:`EntryPoint` of a module in a folder of components.

    ``sliding_mode.py`` is the component ``sliding-mode``. Its factory is the function with the noun
    of the group as its name, such as ``controller``.
    """

    name: str
    value: str
    dist: Any

    def load(self) -> Any:
        """Import the code."""
        module, _, factory = self.value.partition(":")
        return getattr(import_module(module), factory)


def noun(group: str) -> str:
    """Return the noun of one component of a group for messages, such as ``controller``."""
    return group.removesuffix("s")


def component_names(group: Group) -> tuple[str, ...]:
    """Return the names of the installed components of a group, those of this package first.

    Raises:
        InvalidInput: There is no such group.
    """
    return tuple(entries_of(group))


@cache
def entries_of(group: Group) -> dict[str, list[EntryPoint]]:
    """Return the entry points of a group by name.

    Raises:
        InvalidInput: There is no such group.
    """
    if group not in GROUPS:
        raise InvalidInput(f"there is no group of components {group!r}{suggestion(group, GROUPS)}")
    found: dict[str, list[EntryPoint]] = {}
    declared: list[EntryPoint] = list(entry_points(group=f"omnidrive.{group}"))
    for entry in sorted([*declared, *_modules(group, declared)], key=_order):
        entries = found.setdefault(entry.name, [])
        if all(entry.value != other.value for other in entries):  # installed twice, as in a venv
            entries.append(entry)
    return found


def _modules(group: str, declared: Iterable[EntryPoint]) -> list[EntryPoint]:
    """Return the components of this package in the folder of a group, without importing them."""
    own = next((entry.dist for entry in declared if distribution_of(entry) == _OWN), None)
    if own is None or group not in _FOLDERS:
        return []
    folder = _FOLDERS[group]
    package = f"{_OWN}.{folder.replace('/', '.')}"
    return [
        _Module(each.name.replace("_", "-"), f"{package}.{each.name}:{noun(group)}", own)
        for each in iter_modules([str(_PACKAGE / folder)])
    ]


def _order(entry: EntryPoint) -> tuple[bool, str]:
    name = distribution_of(entry)
    return (name != _OWN, name)


def distribution_of(entry: EntryPoint) -> str:
    """Return the name of the distribution that declares an entry point."""
    name: str = entry.dist.name if entry.dist else ""
    return name
