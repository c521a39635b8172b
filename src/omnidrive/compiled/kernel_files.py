"""Machine code of kernels on disk: a file for each kernel, key and signature.

The key (:mod:`omnidrive.compiled.key`) covers the code and what compiles it; the hash at the end of
the file name covers the types of the arguments and the processor. The line numbers in the traceback
of an error that a kernel raises are those at the time of compilation.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
from numba import config

from omnidrive.compiled.cache_folder import SUFFIX, usable_folder
from omnidrive.compiled.key import kernel_key, short_hash, type_text

_config: Any = config  # neither has types
_llvm: Any = llvm


class KernelFiles:
    """Files of one kernel."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel

    @property
    def cache_path(self) -> str:
        """Folder of the files; empty: there is none."""
        folder = usable_folder()
        return str(folder.path) if folder else ""

    def flush(self) -> None:
        """Remove the files of this kernel with its present key."""
        folder = usable_folder()
        for name in entries(self._kernel):
            if folder:
                folder.remove(name)

    def read(self, arguments: Any) -> bytes | None:
        """Return the content for the types of the arguments; None: there is no valid file."""
        folder = usable_folder()
        return folder.read(self._name(arguments)) if folder else None

    def write(self, arguments: Any, content: bytes) -> None:
        """Keep the content for the types of the arguments, if there is a usable folder."""
        folder = usable_folder()
        if folder:
            folder.write(self._name(arguments), content)

    def mark_used(self, arguments: Any) -> None:
        """Note the use of a file, see :meth:`~.cache_folder.CacheFolder.mark_used`."""
        folder = usable_folder()
        if folder:
            folder.mark_used(self._name(arguments))

    @contextmanager
    def locked(self, arguments: Any) -> Iterator[bytes | None]:
        """Yield the content of the valid file; if there is none, hold its lock during the block.

        Waits at most two minutes for another process that compiles it, and continues without the
        lock afterwards, or if the file system has no locks.
        """
        folder = usable_folder()
        content = self.read(arguments)
        if folder is None or content is not None:
            yield content
            return
        with folder.locked(self._name(arguments)):
            yield self.read(arguments)

    def _name(self, arguments: Any) -> str:
        texts = "\n".join([*map(type_text, arguments), *_processor()])
        return f"{_entry_name(self._kernel)}-{short_hash(texts)}{SUFFIX}"


def entries(kernel: Any) -> list[str]:
    """Return the names of the files of a kernel with its present key, one for each signature."""
    folder = usable_folder()
    return folder.names(f"{_entry_name(kernel)}-") if folder else []


def qualified_name(kernel: Any) -> str:
    """Name of a kernel with its module within the package."""
    module = kernel.py_func.__module__.removeprefix("omnidrive.")
    return f"{module}.{kernel.py_func.__qualname__}"


def _entry_name(kernel: Any) -> str:
    function = kernel.py_func
    name = f"{function.__module__}.{function.__qualname__}".replace("<", "").replace(">", "")
    return f"{name[-150:]}-{kernel_key(kernel)}"


def _processor() -> list[str]:
    """Texts of the processor that the machine code is for."""
    features = _config.CPU_FEATURES
    return [
        _llvm.get_process_triple(),
        _config.CPU_NAME or _llvm.get_host_cpu_name(),
        _llvm.get_host_cpu_features().flatten() if features is None else features,
    ]
