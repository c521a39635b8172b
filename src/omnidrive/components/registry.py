"""Registry of components: entry points of installed distributions, and code named by the user."""

from __future__ import annotations

from functools import cache

from omnidrive.components.code import (
    CodePermission,
    guarded_import,
    import_code,
    is_allowed,
    is_code,
)
from omnidrive.components.component import Component, UnreadComponent
from omnidrive.components.entry_points import (
    EntryPoint,
    Group,
    component_names,
    distribution_of,
    entries_of,
    noun,
)
from omnidrive.errors import InvalidInput, one_line, suggestion


def find_component(
    group: Group, name: str, *, allow_code: bool | CodePermission = False
) -> Component:
    """Return a component by the name of its entry point or by the name of its code.

    Args:
        group: Group of the component.
        name: Name of an entry point, ``FILE.py:ATTRIBUTE`` or ``MODULE:ATTRIBUTE``.
        allow_code: Whether code that is not declared as an entry point may be imported. A name in a
            file is not trusted. Code that was allowed before, in this process, is found again.

    Raises:
        InvalidInput: There is no such component, its code is not allowed or cannot be imported.
    """
    entries, kind = entries_of(group).get(name), noun(group)
    if entries is not None:
        return _installed(group, tuple(entries))
    if name.endswith(".py"):
        raise InvalidInput(
            f"the {kind} '{one_line(name, 60)}' needs the name of its class: FILE.py:NAME"
        )
    if not is_code(name):
        hint = suggestion(name, component_names(group))
        raise InvalidInput(
            f"there is no {kind} '{one_line(name, 60)}'{hint} (your own: FILE.py:NAME)"
        )
    permission = CodePermission.of(allow_code)
    if permission is CodePermission.UNREAD and not is_allowed(name):
        return UnreadComponent.named(group, name)
    factory, origin = import_code(kind, name, permission)
    return Component(group, name, origin, factory)


@cache  # reading the version of a distribution takes milliseconds
def _installed(group: Group, entries: tuple[EntryPoint, ...]) -> Component:
    entry, *others = entries
    kind = noun(group)
    if others:
        owners = ", ".join(map(distribution_of, entries))
        raise InvalidInput(
            f"the {kind} '{entry.name}' is declared by several distributions: {owners}; uninstall "
            "all but one, or use its code as MODULE:NAME"
        )
    factory = guarded_import(kind, entry.name, entry.load, distribution_of(entry))
    version = entry.dist.version if entry.dist else "unknown"
    return Component(group, entry.name, f"{distribution_of(entry)} {version}", factory)
