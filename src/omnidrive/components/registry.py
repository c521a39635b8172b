"""Registry of components: entry points of installed distributions, and code named by the user."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from omnidrive.components.component import Component, failure_text
from omnidrive.components.entry_points import (
    EntryPoint,
    Group,
    component_names,
    distribution_of,
    entries_of,
    noun,
)
from omnidrive.errors import PART_ERRORS, InvalidInput, OmnidriveError, one_line, suggestion
from omnidrive.files.bounded_file import read_bounded

_MAX_CODE = 10_000_000  # bytes of a Python file


def find_component(group: Group, name: str, *, allow_code: bool = False) -> Component:
    """Return a component by the name of its entry point or by the name of its code.

    Args:
        group: Group of the component.
        name: Name of an entry point, ``FILE.py:ATTRIBUTE`` or ``MODULE:ATTRIBUTE``.
        allow_code: Whether code that is not declared as an entry point may be imported. A name in a
            scenario file is not trusted.

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
    if ":" not in name:
        hint = suggestion(name, component_names(group))
        raise InvalidInput(
            f"there is no {kind} '{one_line(name, 60)}'{hint} (your own: FILE.py:NAME)"
        )
    if not allow_code:
        raise InvalidInput(
            f"the {kind} '{one_line(name)}' is code that is not installed; if you trust it, allow "
            "it with --allow-code (in Python: allow_code=True)"
        )
    module_name, _, attribute = name.rpartition(":")
    if module_name.endswith(".py"):
        module, origin = _load_file(kind, name, Path(module_name))
    elif not all(map(str.isidentifier, module_name.split("."))):
        raise InvalidInput(
            f"the {kind} '{one_line(name, 60)}' is neither FILE.py:NAME nor MODULE:NAME"
        )
    else:
        module = _guarded_import(kind, name, lambda: import_module(module_name))
        origin = f"module {module_name}, SHA-256 {_digest(module)}"
    return Component(group, name, origin, _attribute(kind, name, module, attribute))


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
    factory = _guarded_import(kind, entry.name, entry.load, distribution_of(entry))
    version = entry.dist.version if entry.dist else "unknown"
    return Component(group, entry.name, f"{distribution_of(entry)} {version}", factory)


def _load_file(kind: str, name: str, path: Path) -> tuple[ModuleType, str]:
    """Import a Python file; a file with the same content is imported only once."""
    content = read_bounded(path, _MAX_CODE, kind, InvalidInput, excess="is too large for code")
    digest = sha256(content).hexdigest()
    module_name = f"omnidrive_code_{digest[:16]}"
    if module_name not in sys.modules:
        spec = spec_from_file_location(module_name, path.resolve())
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        sys.modules[module_name] = module  # dataclasses look their module up

        def run() -> None:
            """Execute the content of the file in the namespace of its module."""
            exec(compile(content, str(path.resolve()), "exec", dont_inherit=True), module.__dict__)

        try:
            _guarded_import(kind, name, run)
        except BaseException:
            sys.modules.pop(module_name, None)
            raise
    else:
        module = sys.modules[module_name]
    return module, f"{path.name}, SHA-256 {digest}"


def _guarded_import(
    kind: str, name: str, load: Callable[[], Any], distribution: str | None = None
) -> Any:
    """Return the result of ``load``; an exception or an exit becomes a message with the calls."""
    try:
        return load()
    except OmnidriveError:
        raise
    except PART_ERRORS as error:
        origin = f" of the distribution {distribution}" if distribution else ""
        raise InvalidInput(
            f"the {kind} '{one_line(name)}'{origin} cannot be imported{failure_text(error)}"
        ) from None


def _attribute(kind: str, name: str, module: ModuleType, attribute: str) -> Callable[..., Any]:
    absent = object()
    found = _guarded_import(kind, name, lambda: getattr(module, attribute, absent))
    if found is absent:
        own = [n for n, v in vars(module).items() if callable(v) and not n.startswith("_")]
        raise InvalidInput(
            f"the {kind} '{one_line(name)}' does not exist{suggestion(attribute, own)}"
        )
    if not callable(found):
        raise InvalidInput(f"the {kind} '{one_line(name)}' is not a class or function")
    factory: Callable[..., Any] = found
    return factory


def _digest(module: ModuleType) -> str:
    """Return the hash of the file of a module; `unknown` without a file."""
    file = getattr(module, "__file__", None)
    return sha256(Path(file).read_bytes()).hexdigest() if file else "unknown"
