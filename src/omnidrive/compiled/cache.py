"""Machine code of kernels on disk: a file for each kernel, key and signature.

The key (:mod:`omnidrive.compiled.key`) covers the code; the signature covers the types of the
arguments and the processor. The line numbers in the traceback of an error that a kernel raises are
those at the time of compilation.
"""

from __future__ import annotations

import logging
import os
import pickle
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, cast
from uuid import uuid4

from numba.core import compiler, config, sigutils
from numba.core.serialize import dumps

from omnidrive.compiled.key import kernel_key, short_hash, type_text

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_log = logging.getLogger("omnidrive")
_config: Any = config  # none of these has complete types
_compiler: Any = compiler
_signatures: Any = sigutils
_dumps: Any = dumps

_DAY = 86400.0
_MAX_UNUSED_DAYS, _MAX_ENTRIES = 60, 4000


class KernelCache:
    """Cache of one kernel: a file per key and signature."""

    def __init__(self, kernel: Any) -> None:
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
        """Write a compiled kernel; other processes find the old entry or the complete new one."""
        if not result.library.is_complete or result.library.has_dynamic_globals:
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
            _warn_once(f"compiled kernels cannot be cached in {path.parent}: {error}")

    @contextmanager
    def locked(self, signature: Any) -> Iterator[bool]:
        """Yield whether there is an entry, after other processes that compile it are done."""
        path = self._path(signature, self._kernel.targetctx.codegen())
        offset = int(short_hash(path.name)[:7], 16)
        lock = None if path.exists() else _lock_file(path.parent)
        if lock is None:
            yield path.exists()
            return
        with suppress(OSError):  # a file system without locks: compile in every process
            fcntl.lockf(lock, fcntl.LOCK_EX, 1, offset)
        try:
            yield path.exists()
        finally:
            with suppress(OSError):
                fcntl.lockf(lock, fcntl.LOCK_UN, 1, offset)

    def _path(self, signature: Any, codegen: Any) -> Path:
        arguments, result = _signatures.normalize_signature(signature)
        types = [*map(type_text, arguments), str(result)]
        texts = "\n".join([*types, *map(str, codegen.magic_tuple())])
        return cache_folder() / f"{_entry_name(self._kernel)}-{short_hash(texts)}.nbc"


def _checked(content: bytes) -> tuple[Any, ...]:
    """Return the contents of an entry, whose first 32 bytes are the checksum of the others."""
    digest, data = content[:32], content[32:]
    if sha256(data).digest() != digest:
        raise ValueError("its checksum is wrong")
    return cast("tuple[Any, ...]", pickle.loads(data))


def entries(kernel: Any) -> Iterator[Path]:
    """Return the files of a kernel with its present key, one for each signature."""
    return cache_folder().glob(f"{_entry_name(kernel)}-*.nbc")


def cache_folder() -> Path:
    """Return the folder of the entries: NUMBA_CACHE_DIR, beside this file, or in ~/.cache."""
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


@cache
def _lock_file(folder: Path) -> int | None:
    """Return the descriptor of the lock file, of which each kernel locks one byte."""
    if fcntl is None:
        return None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:
        return None


def _mark_used(path: Path) -> None:
    """Set the modification time of an entry to now, at most once a day."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > _DAY:
            os.utime(path)


@cache
def _remove_unused(folder: Path) -> None:
    """Remove entries unused for 60 days and the oldest beyond 4000; once per process."""
    ages: list[tuple[float, Path]] = []
    for path in folder.glob("*.nbc*"):
        with suppress(OSError):
            ages.append((time.time() - path.stat().st_mtime, path))
    for number, (age, path) in enumerate(sorted(ages)):
        if age > _MAX_UNUSED_DAYS * _DAY or number >= _MAX_ENTRIES:
            with suppress(OSError):
                path.unlink()


_warned: set[str] = set()


def _warn_once(message: str) -> None:
    if not _warned:
        _log.warning(message)
    _warned.add(message)
