"""Import of code that is not installed: the only place where the name of code becomes a module.

Files may come from somebody else. A name in a file is therefore no reason to import code: the user
names the code, on the command line or in Python, or allows what a file names.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable
from enum import Enum
from hashlib import sha256
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from omnidrive.components.component import failure_text
from omnidrive.errors import PART_ERRORS, InvalidInput, OmnidriveError, one_line, suggestion
from omnidrive.files.bounded_file import read_bounded

_MAX_CODE = 10_000_000  # bytes of a Python file

NO_FILE = "unknown"
"""In place of the hash of code that is in no file, such as that of a session."""

_allowed: set[str] = set()  # code that the user named or allowed in this process


class CodePermission(Enum):
    """Whether code that is not installed may be imported.

    What is allowed once stays allowed in the process, so that parts of a scenario can be checked
    again.
    """

    GRANTED = "granted"
    """The user names the code, or allows what a file names."""
    REFUSED = "refused"
    """A name of code that is not allowed yet is an error."""
    UNREAD = "unread"
    """Such code is not imported, and its component has a name only: stored runs need no code."""

    @classmethod
    def of(cls, allow_code: bool | CodePermission) -> CodePermission:
        """Return the permission that a truth value stands for."""
        if isinstance(allow_code, CodePermission):
            return allow_code
        return cls.GRANTED if allow_code else cls.REFUSED


def is_code(name: str) -> bool:
    """Return whether the name of a component is ``FILE.py:NAME`` or ``MODULE:NAME``."""
    return ":" in name


def is_allowed(name: str) -> bool:
    """Return whether the user named or allowed this code in this process."""
    return _key(name) in _allowed


def allowed_code() -> frozenset[str]:
    """Return what another process of the same user may import, for :func:`allow`."""
    return frozenset(_allowed)


def allow(keys: Iterable[str]) -> None:
    """Allow what :func:`allowed_code` returned in the process that started this one."""
    _allowed.update(keys)


def import_code(kind: str, name: str, permission: CodePermission) -> tuple[Callable[..., Any], str]:
    """Import a class or function that is not installed.

    Args:
        kind: Noun of the component, for messages.
        name: ``FILE.py:NAME`` or ``MODULE:NAME``.
        permission: Whether it may be imported.

    Returns:
        The class or function, and where it comes from: file or module, and its hash.

    Raises:
        InvalidInput: The code is not allowed, does not exist or cannot be imported.
    """
    if permission is not CodePermission.GRANTED and not is_allowed(name):
        raise InvalidInput(
            f"the {kind} '{one_line(name)}' is code that is not installed; if you trust it, allow "
            "it with --allow-code (in Python: allow_code=True)"
        )
    place, _, attribute = name.rpartition(":")
    if place.endswith(".py"):
        _allowed.add(_key(name))
        module, origin = _load_file(kind, name, Path(place))
    elif not all(map(str.isidentifier, place.split("."))):
        raise InvalidInput(
            f"the {kind} '{one_line(name, 60)}' is neither FILE.py:NAME nor MODULE:NAME"
        )
    else:
        _allowed.add(_key(name))
        module = guarded_import(kind, name, lambda: import_module(place))
        origin = f"module {place}, SHA-256 {_digest(module)}"
    return _attribute(kind, name, module, attribute), origin


def _key(name: str) -> str:
    """Return a name of code that is the same in every working folder."""
    place, _, attribute = name.rpartition(":")
    if place.endswith(".py") and "\0" not in place:
        place = str(Path(place).absolute())
    return f"{place}:{attribute}"


def _load_file(kind: str, name: str, path: Path) -> tuple[ModuleType, str]:
    """Import a Python file; a file with the same content is imported only once."""
    if not path.is_absolute() and not os.path.exists(path):
        raise InvalidInput(
            f"the {kind} '{one_line(name)}' does not exist: the name of code is relative to the "
            f"working folder, {one_line(str(Path.cwd()))}"
        )
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
            guarded_import(kind, name, run)
        except BaseException:
            sys.modules.pop(module_name, None)
            raise
    else:
        module = sys.modules[module_name]
    return module, f"{path.name}, SHA-256 {digest}"


def guarded_import(
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
    found = guarded_import(kind, name, lambda: getattr(module, attribute, absent))
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
    """Return the hash of the file of a module."""
    file = getattr(module, "__file__", None)
    return sha256(Path(file).read_bytes()).hexdigest() if file else NO_FILE
