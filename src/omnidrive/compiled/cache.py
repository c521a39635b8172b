"""Machine code of kernels on disk: a file for each kernel, key and signature.

The key (:mod:`omnidrive.compiled.key`) covers the code; the hash at the end of the file name covers
the types of the arguments and the result, and the processor. The line numbers in the traceback of
an error that a kernel raises are those at the time of compilation.
"""

from __future__ import annotations

import logging
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import compiler, sigutils
from numba.core.serialize import dumps

from omnidrive.compiled.cache_folder import SUFFIX, CacheFolder, usable_folder
from omnidrive.compiled.key import kernel_key, short_hash, type_text

_log = logging.getLogger("omnidrive.compiled.cache")
_compiler: Any = compiler  # none of these has complete types
_signatures: Any = sigutils
_dumps: Any = dumps


class KernelCache:
    """Disk cache of one kernel, with the interface of the ``_cache`` of a Numba dispatcher."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel
        self._read: dict[str, bytes] = {}  # contents by name, until they are loaded

    @property
    def cache_path(self) -> str:
        """Folder of the entries; empty: there is none."""
        folder = usable_folder()
        return str(folder.path) if folder else ""

    def flush(self) -> None:
        """Remove the entries of this kernel with its present key."""
        folder = usable_folder()
        for name in entries(self._kernel):
            if folder:
                folder.remove(name)

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the compiled kernel for a signature; None: there is no valid entry."""
        target_context.refresh()
        folder = usable_folder()
        if folder is None:
            return None
        name = self._name(signature, target_context.codegen())
        content = self._read.pop(name, None) or folder.read(name)
        if content is None:
            return None
        try:
            result = _compiler.CompileResult._rebuild(target_context, *pickle.loads(content))
        except Exception as error:  # of any class: Numba restores its own objects
            _log.warning(
                "a compiled kernel in %s cannot be loaded (%s); it is compiled again",
                folder.path,
                type(error).__name__,
            )
            return None
        folder.mark_used(name)
        return result

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write a compiled kernel with machine code, unless it has addresses of this process."""
        if not result.library.is_complete or result.library.has_dynamic_globals:
            return
        folder = usable_folder()
        if folder is not None:
            folder.write(self._name(signature, result.codegen), _dumps(result._reduce()))

    @contextmanager
    def locked(self, signature: Any) -> Iterator[bool]:
        """Yield whether there is a valid entry; if not, hold its lock during the block.

        Waits at most two minutes for another process that compiles it, and continues without the
        lock afterwards, or if the file system has no locks.
        """
        folder = usable_folder()
        if folder is None:
            yield False
            return
        name = self._name(signature, self._kernel.targetctx.codegen())
        if self._fetch(folder, name):
            yield True
            return
        with folder.locked(name):
            yield self._fetch(folder, name)

    def _fetch(self, folder: CacheFolder, name: str) -> bool:
        """Read an entry for :meth:`load_overload`; return whether it is valid."""
        content = folder.read(name)
        if content is not None:
            self._read[name] = content
        return content is not None

    def _name(self, signature: Any, codegen: Any) -> str:
        arguments, result = _signatures.normalize_signature(signature)
        types = [*map(type_text, arguments), str(result)]
        texts = "\n".join([*types, *map(str, codegen.magic_tuple())])
        return f"{_entry_name(self._kernel)}-{short_hash(texts)}{SUFFIX}"


def entries(kernel: Any) -> list[str]:
    """Return the names of the files of a kernel with its present key, one for each signature."""
    folder = usable_folder()
    return folder.names(f"{_entry_name(kernel)}-") if folder else []


def _entry_name(kernel: Any) -> str:
    function = kernel.py_func
    name = f"{function.__module__}.{function.__qualname__}".replace("<", "").replace(">", "")
    return f"{name[-150:]}-{kernel_key(kernel)}"
