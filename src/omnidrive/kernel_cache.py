"""Disk cache of compiled kernels, keyed by the code that a kernel can reach.

Numba's own cache renews an entry when the file of a kernel changes, but not when a kernel that it
calls, or a constant of another module, changes. Here the key of an entry is a hash of everything
that determines the machine code:

* the byte code and the constants of the kernel, without docstring, file name and line numbers;
* its default arguments and compiler options;
* every global and closure value that the code refers to: other kernels and functions with all that
  they refer to in turn, numbers, strings, tuples, arrays, enumerations, and the fields of named
  tuples;
* the types of the arguments;
* the processor, and the versions of Python, Numba, llvmlite and NumPy.

So an edit of a docstring, of a comment or of an unrelated file leaves every entry valid. The line
numbers in the traceback of an error that a kernel raises are those at the time of compilation.

This is the only file that depends on internals of Numba: the cache interface of a dispatcher
(``Dispatcher._cache`` with ``load_overload`` and ``save_overload``), ``CompileResult._reduce`` and
``_rebuild``, ``numba.core.serialize.dumps``, ``_Intrinsic._defn``, and ``config``, whose attributes
are set at run time. The bounds of Numba in ``pyproject.toml`` are the versions that provide them.
"""

from __future__ import annotations

import logging
import os
import pickle
import sys
import time
from collections.abc import Collection, Iterator
from contextlib import suppress
from dis import opmap
from enum import Enum
from functools import cache
from hashlib import sha256
from inspect import CO_GENERATOR, CO_VARARGS, CO_VARKEYWORDS
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple, cast
from uuid import uuid4

import llvmlite
import numba
import numpy as np
from numba.core import compiler, config, sigutils, types
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic
from numba.core.serialize import dumps

_log = logging.getLogger("omnidrive")
_config: Any = config  # none of these has complete types
_compiler: Any = compiler
_signatures: Any = sigutils
_dumps: Any = dumps

_LOAD_GLOBAL, _EXTENDED_ARG = opmap["LOAD_GLOBAL"], opmap["EXTENDED_ARG"]
_CALL_FLAGS = CO_VARARGS | CO_VARKEYWORDS | CO_GENERATOR
_CHECKS = {"jaxtyping", "beartype"}  # they wrap functions in tests; no machine code depends on them
_FOREIGN = {"numba", "numpy", "llvmlite", *_CHECKS, *sys.stdlib_module_names} - {"__main__"}
_DAY = 86400.0
_UNUSED_DAYS, _MOST_ENTRIES = 60, 4000


class KernelCache:
    """Cache of one kernel: a file per key and signature."""

    def __init__(self, kernel: Dispatcher) -> None:
        self._kernel = kernel

    @property
    def cache_path(self) -> str:
        """Folder of the entries."""
        return str(cache_folder())

    def enable(self) -> None:
        """Do nothing: the cache is always on."""

    def disable(self) -> None:
        """Do nothing: the cache is always on."""

    def flush(self) -> None:
        """Remove all entries of this kernel."""
        for path in entries(self._kernel):
            path.unlink(missing_ok=True)

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the compiled kernel for a signature; None: absent or unreadable."""
        target_context.refresh()
        path = self._path(signature, target_context.codegen())
        try:
            content = path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            _warn_once(f"cannot read the compiled kernel {path}: {error}; compiling it again")
            return None
        try:
            result = _compiler.CompileResult._rebuild(target_context, *_checked(content))
        except Exception as error:
            _warn_once(f"the compiled kernel {path} is damaged ({error}); compiling it again")
            return None
        _mark_used(path)
        return result

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write a compiled kernel, in place of an older entry; in one step for other processes."""
        if result.library.has_dynamic_globals or any(not part.can_cache for part in result.lifted):
            return
        path = self._path(signature, result.codegen)
        data = _dumps(result._reduce())
        unfinished = path.with_name(f"{path.name}.{uuid4().hex[:16]}.tmp")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            unfinished.write_bytes(sha256(data).digest() + data)
            os.replace(unfinished, path)
            _remove_unused(path.parent)
        except OSError as error:
            with suppress(OSError):
                unfinished.unlink(missing_ok=True)
            _warn_once(f"compiled kernels cannot be kept in {path.parent}: {error}")

    def _path(self, signature: Any, codegen: Any) -> Path:
        arguments, result = _signatures.normalize_signature(signature)
        told = "\n".join(
            [*map(_type_text, arguments), str(result), *map(str, codegen.magic_tuple())]
        )
        return cache_folder() / f"{_entry_name(self._kernel)}-{_short(told)}.nbc"


def _checked(content: bytes) -> tuple[Any, ...]:
    """Contents of an entry, whose first bytes are the checksum of the others."""
    digest, data = content[:32], content[32:]
    if sha256(data).digest() != digest:
        raise ValueError("its checksum is wrong")
    return cast("tuple[Any, ...]", pickle.loads(data))


def attach_cache(kernel: Any) -> bool:
    """Keep the machine code of a kernel on disk; False: NUMBA_DISABLE_JIT is set."""
    if not isinstance(kernel, Dispatcher):
        return False
    dispatcher: Any = kernel
    dispatcher._cache = KernelCache(kernel)
    return True


def entries(kernel: Any) -> Iterator[Path]:
    """Files of a kernel as it is now, one for each signature."""
    return cache_folder().glob(f"{_entry_name(kernel)}-*.nbc")


def cache_folder() -> Path:
    """Folder of the entries: the user's choice, beside the package, or in the user's cache."""
    return _folder(_config.CACHE_DIR)


@cache
def _folder(chosen: str) -> Path:
    package = Path(__file__).parent
    if chosen:
        return Path(chosen) / "omnidrive-kernels"
    if os.access(package, os.W_OK):
        return package / "__pycache__" / "kernels"
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "omnidrive" / "kernels"


def _entry_name(kernel: Any) -> str:
    function = kernel.py_func
    name = f"{function.__module__}.{function.__qualname__}".replace("<", "").replace(">", "")
    return f"{name[-150:]}-{kernel_key(kernel)}"


def kernel_key(kernel: Any) -> str:
    """Hash of all code and values that a kernel can reach, and of what compiles it."""
    reached: dict[Any, str] = {}
    waiting: list[Any] = [kernel]
    while waiting:
        part = waiting.pop()
        if part not in reached:
            reached[part], uses = _described(part)
            waiting += uses
    return _short("\n".join([reached[kernel], *sorted(reached.values()), *_compiler_text()]))


def _compiler_text() -> list[str]:
    versions = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__)
    settings = (_config.OPT, _config.DEBUGINFO_DEFAULT, _config.BOUNDSCHECK)
    loops = (_config.LOOP_VECTORIZE, _config.SLP_VECTORIZE)
    return [str(item) for item in (*versions, np.__version__, *settings, *loops)]


class _Description(NamedTuple):
    """Hash of a function itself, and the functions that it refers to."""

    digest: str
    uses: tuple[Any, ...]


@cache
def _described(part: Any) -> _Description:
    """Describe a kernel, a function or an intrinsic, without what it refers to in turn."""
    uses: list[Any] = []
    function: FunctionType = part
    options = ""
    if isinstance(part, Dispatcher):
        function = part.py_func
        options = _text(part.targetoptions, uses) + _text(part.locals, uses)
    elif isinstance(part, _Intrinsic):
        function = part._defn
        options = f"intrinsic {part._prefer_literal} {part._ctor_kwargs}"
    code = function.__code__
    texts = [_name(function), options]
    texts += [_text(function.__defaults__, uses), _text(function.__kwdefaults__, uses)]
    texts += _code_texts(code, function.__doc__, uses)
    for cell in function.__closure__ or ():
        texts.append(_text(cell.cell_contents, uses))
    for name, attributes in sorted(_global_names(code).items()):
        if name in function.__globals__:
            texts.append(f"{name} = {_text(function.__globals__[name], uses, attributes)}")
        else:
            texts.append(f"{name}: built in")
    return _Description(_short("\n".join(texts)), tuple(uses))


def _code_texts(code: CodeType, docstring: str | None, uses: list[Any]) -> Iterator[str]:
    """Everything of a code object that determines what it does."""
    constants = list(code.co_consts)
    if docstring is not None and constants and isinstance(constants[0], str):
        constants[0] = None
    yield code.co_code.hex()
    yield code.co_exceptiontable.hex()
    yield repr((code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars))
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
    yield repr((*counts, code.co_flags & _CALL_FLAGS))
    for constant in constants:
        if isinstance(constant, CodeType):
            yield from _code_texts(constant, None, uses)
        else:
            yield _text(constant, uses)


def _global_names(code: CodeType) -> dict[str, set[str]]:
    """Names of the globals that a code object loads, each with all names used as attributes."""
    found: dict[str, set[str]] = {}
    raw = code.co_code
    argument = 0
    for at in range(0, len(raw), 2):
        argument = argument << 8 | raw[at + 1]
        if raw[at] == _LOAD_GLOBAL:
            found[code.co_names[argument >> 1]] = set(code.co_names)
        if raw[at] != _EXTENDED_ARG:
            argument = 0
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            for name, attributes in _global_names(constant).items():
                found.setdefault(name, set()).update(attributes)
    return found


def _text(  # noqa: PLR0911 - one for each type
    value: Any, uses: list[Any], attributes: set[str] | None = None
) -> str:
    """Describe a value; functions are added to ``uses``, and only named here.

    Raises:
        TypeError: The value is of a type that no kernel may refer to.
    """
    kind = type(value)
    if value is None or value is Ellipsis or kind in {bool, int, float, complex, str, bytes}:
        return f"{kind.__name__} {value!r}"
    if isinstance(value, Dispatcher | FunctionType | _Intrinsic):
        if not _is_foreign(value):
            uses.append(value)
        return f"function {_name(value)}"
    if isinstance(value, type):
        return _class_text(value, uses)
    if isinstance(value, ModuleType):
        return _module_text(value, uses, attributes or set())
    if isinstance(value, np.ndarray | np.generic):
        return _array_text(value)
    if isinstance(value, Enum):
        return f"{_class_text(kind, uses)}.{value.name}"
    if isinstance(value, tuple | list | set | frozenset | dict):
        return _items_text(value, uses)
    if isinstance(value, types.Type | np.dtype | np.ufunc) or _is_foreign(value):
        return f"{_name(kind)} {getattr(value, '__name__', None) or value}"
    raise TypeError(f"a kernel cannot refer to {value!r}, a {kind.__name__}")


def _array_text(value: np.ndarray | np.generic) -> str:
    """Type, layout and contents of an array."""
    array = np.asarray(value)
    if array.dtype.hasobject:
        raise TypeError(f"a kernel cannot refer to an array of objects: {value!r}")
    layout = (array.dtype.descr, array.shape, array.strides, array.flags.writeable)
    return f"{type(value).__name__} {layout} {sha256(array.tobytes()).hexdigest()}"


def _items_text(values: Collection[Any], uses: list[Any]) -> str:
    """Class and items of a collection; without order where it has none."""
    if isinstance(values, dict):
        texts = [f"{_text(key, uses)}: {_text(item, uses)}" for key, item in values.items()]
    else:
        texts = [_text(item, uses) for item in values]
    if not isinstance(values, tuple | list):
        texts.sort()
    return f"{_class_text(type(values), uses)}({', '.join(texts)})"


def _class_text(cls: type, uses: list[Any]) -> str:
    """Name of a class; with its members if it is an enumeration, its fields if a named tuple."""
    text = f"class {_name(cls)}"
    if issubclass(cls, Enum):
        members = {name: _text(item.value, uses) for name, item in cls.__members__.items()}
        return f"{text} {members}"
    if issubclass(cls, tuple) and hasattr(cls, "_fields"):
        defaults = _text(getattr(cls, "_field_defaults", {}), uses)
        return f"{text} {cls._fields} {cls.__annotations__} {defaults}"
    return text


def _module_text(module: ModuleType, uses: list[Any], attributes: set[str]) -> str:
    """Name of a module, and what the kernel may use of it."""
    if _is_foreign(module):
        return f"module {module.__name__}"
    used = {name: getattr(module, name) for name in sorted(attributes) if hasattr(module, name)}
    return f"module {module.__name__} {_text(used, uses)}"


def _is_foreign(value: Any) -> bool:
    """Whether a value belongs to Python, NumPy or Numba, whose versions are part of the key."""
    if isinstance(value, ModuleType):
        name = value.__name__
    else:
        name = getattr(value, "__module__", None) or type(value).__module__
    return name.split(".")[0] in _FOREIGN


def _type_text(kind: Any) -> str:
    """Text of the type of an argument; with the fields of the named tuples within it."""
    parts = getattr(kind, "types", None) or (getattr(kind, "dtype", None),)
    inner = [_type_text(part) for part in parts if isinstance(part, types.Type)]
    cls = getattr(kind, "instance_class", None)
    own = f"{kind} {_class_text(cls, [])}" if isinstance(cls, type) else str(kind)
    return f"{own}[{', '.join(inner)}]" if inner else own


def _name(value: Any) -> str:
    return f"{value.__module__}.{getattr(value, '__qualname__', type(value).__qualname__)}"


def _short(text: str) -> str:
    return sha256(text.encode()).hexdigest()[:20]


def _mark_used(path: Path) -> None:
    """Renew the time of an entry, at most once a day."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > _DAY:
            os.utime(path)


@cache
def _remove_unused(folder: Path) -> None:
    """Remove what was not used for long, and the oldest beyond a number; once per process."""
    ages: list[tuple[float, Path]] = []
    for path in folder.iterdir():
        with suppress(OSError):
            ages.append((time.time() - path.stat().st_mtime, path))
    for number, (age, path) in enumerate(sorted(ages)):
        if age > _UNUSED_DAYS * _DAY or number >= _MOST_ENTRIES:
            with suppress(OSError):
                path.unlink()


_warned: set[str] = set()


def _warn_once(message: str) -> None:
    if not _warned:
        _log.warning(message)
    _warned.add(message)
