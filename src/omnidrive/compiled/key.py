"""Key of a compiled kernel: a hash of everything that determines its machine code.

Numba's own cache renews an entry when the file of a kernel changes, but not when a kernel that it
calls, or a constant of another module, changes. The key made here covers

* the byte code and the constants of the kernel, without docstring, file name and line numbers;
* its default arguments and compiler options;
* every global and closure value that the code refers to: other kernels and functions with all that
  they refer to in turn, numbers, strings, tuples, arrays, enumerations, and the fields of named
  tuples;
* the versions of Python, Numba, llvmlite and NumPy, and the settings of the compiler.

Intrinsics are covered without options, which those of this package do not have.

So an edit of a docstring, of a comment or of an unrelated file leaves a key as it is. Globals are
read when the key is first needed, not when the kernel is defined.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator
from dis import opmap
from enum import Enum
from functools import cache
from hashlib import sha256
from inspect import CO_GENERATOR, CO_VARARGS, CO_VARKEYWORDS, unwrap
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import llvmlite
import numba
import numpy as np
from numba import config, njit, types
from numba.extending import intrinsic

from omnidrive.compiled.versions import USES_INTERNALS

_njit: Any = njit  # untyped
_intrinsic: Any = intrinsic
_config: Any = config  # its attributes are set at run time

_PASSES = "internal callees" if USES_INTERNALS else "public interfaces"
"""What this package changes in the compiler, which determines the machine code as well."""
_Dispatcher: Any = type(_njit(lambda: 0))
_Intrinsic: Any = type(_intrinsic(lambda _: None))

_LOAD_GLOBAL, _EXTENDED_ARG = opmap["LOAD_GLOBAL"], opmap["EXTENDED_ARG"]
_CALL_FLAGS = CO_VARARGS | CO_VARKEYWORDS | CO_GENERATOR
_CHECKS = {"jaxtyping", "beartype"}  # they wrap functions in tests; no machine code depends on them
_FOREIGN = {"numba", "numpy", "llvmlite", *_CHECKS, *sys.stdlib_module_names} - {"__main__"}


def kernel_key(kernel: Any) -> str:
    """Hash of all code and values that a kernel can reach, and of what compiles it."""
    reached: dict[Any, str] = {}
    waiting: list[Any] = [kernel]
    while waiting:
        part = waiting.pop()
        if part not in reached:
            reached[part], uses = _described(part)
            waiting += uses
    return short_hash("\n".join([reached[kernel], *sorted(reached.values()), *_compiler_text()]))


def _compiler_text() -> list[str]:
    versions = (_PASSES, sys.implementation.cache_tag, numba.__version__, llvmlite.__version__)
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
    if isinstance(part, _Dispatcher):
        function = part.py_func
        options = _text(part.targetoptions, uses) + _text(part.locals, uses)
    elif isinstance(part, _Intrinsic):
        options = "intrinsic"
    function = unwrap(function)  # tests wrap functions, and a wrapper differs in every process
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
    return _Description(short_hash("\n".join(texts)), tuple(uses))


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
    if isinstance(value, (_Dispatcher, FunctionType, _Intrinsic)):
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


def type_text(kind: Any) -> str:
    """Text of the type of an argument; with the fields of the named tuples within it."""
    parts = getattr(kind, "types", None) or (getattr(kind, "dtype", None),)
    inner = [type_text(part) for part in parts if isinstance(part, types.Type)]
    cls = getattr(kind, "instance_class", None)
    own = f"{kind} {_class_text(cls, [])}" if isinstance(cls, type) else str(kind)
    return f"{own}[{', '.join(inner)}]" if inner else own


def _name(value: Any) -> str:
    return f"{value.__module__}.{getattr(value, '__qualname__', type(value).__qualname__)}"


def short_hash(text: str) -> str:
    """Return the first 80 bits of the SHA-256 of a text."""
    return sha256(text.encode()).hexdigest()[:20]
