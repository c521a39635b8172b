"""Completion of the values of options in bash, zsh and fish."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from omnidrive.components import component_names
from omnidrive.components.entry_points import Group

Complete = Callable[[str], list[str]]
"""Function from an incomplete value to complete ones; if there are none, the shell lists files."""


def one_of(names: Iterable[str]) -> Complete:
    """Return the completion of a value that is one of ``names``."""
    known = list(names)

    def complete(incomplete: str) -> list[str]:
        """Return the names that begin in this way."""
        return [name for name in known if name.startswith(incomplete)]

    return complete


def some_of(names: Iterable[str]) -> Complete:
    """Return the completion of a comma-separated list of ``names``: its last name is completed."""
    known = list(names)

    def complete(incomplete: str) -> list[str]:
        """Return the list with each name that its last one begins, and that it lacks."""
        *given, last = incomplete.split(",")
        start = "".join(f"{name}," for name in given)
        return [start + n for n in known if n.startswith(last) and n not in given]

    return complete


def component(group: Group) -> Complete:
    """Return the completion of a value that is the name of an installed component of a group."""

    def complete(incomplete: str) -> list[str]:
        """Return the names of installed components that begin in this way."""
        return [name for name in component_names(group) if name.startswith(incomplete)]

    return complete


def several_components(group: Group) -> Complete:
    """Return the completion of a comma-separated list of names of components of a group."""

    def complete(incomplete: str) -> list[str]:
        """Return the list with its last name completed."""
        return some_of(component_names(group))(incomplete)

    return complete


def paper_or_file(incomplete: str) -> list[str]:
    """Complete ``paper``, the name of the default scenario.

    If nothing is typed, or a file or folder begins in the same way, the shell lists files.
    """
    if not incomplete or not "paper".startswith(incomplete):
        return []
    return [] if any(Path().glob(f"{incomplete}*")) else ["paper"]
