"""Kernels on public interfaces of Numba, for every version.

Numba's own cache on disk checks only the file of a kernel. Here each compilation has a cache folder
of its own, which is unpacked from, and packed into, the file of the kernel, its key and its
signature (:mod:`omnidrive.compiled.kernel_files`). Numba compiles an edited source file again,
also where the key has not changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import local
from typing import Any
from zipfile import ZipFile

from numba import njit

from omnidrive.compiled.cache_folder import numba_folder
from omnidrive.compiled.compilation import reported
from omnidrive.compiled.kernel_files import KernelFiles, qualified_name

_njit: Any = njit  # untyped
_thread = local()


def make_public_kernel(function: Callable[..., Any], targetoptions: Mapping[str, Any]) -> Any:
    """Return the dispatcher of a function, which reads and writes the files of the kernel."""
    kernel = _njit(**targetoptions)(function)
    files, compile_now = KernelFiles(kernel), kernel.compile

    def compile_kernel(signature: Any) -> Any:
        """Compile for the types of the arguments, or load the machine code."""
        arguments = tuple(signature)
        if arguments in kernel.signatures:
            return compile_now(arguments)
        with ExitStack() as stack:
            content = stack.enter_context(files.locked(arguments))
            folder = Path(
                stack.enter_context(
                    TemporaryDirectory(prefix="omnidrive-", ignore_cleanup_errors=True)
                )
            )
            if content is not None:
                ZipFile(BytesIO(content)).extractall(folder)
            with numba_folder(folder), suppress(RuntimeError):  # a function without a source file
                kernel.enable_caching()
            stack.enter_context(_reported_once(kernel, content))
            hits = kernel.stats.cache_hits[arguments]
            compiled = compile_now(arguments)
            if kernel.stats.cache_hits[arguments] > hits:
                files.mark_used(arguments)
            else:
                _keep(files, arguments, folder)
            return compiled

    kernel.compile = compile_kernel
    return kernel


def _keep(files: KernelFiles, arguments: tuple[Any, ...], folder: Path) -> None:
    """Write the files of a folder, if there are any, into the file of a kernel."""
    found = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    if found:
        content = BytesIO()
        with ZipFile(content, "w") as packed:
            for path in found:
                packed.write(path, path.relative_to(folder))
        files.write(arguments, content.getvalue())


@contextmanager
def _reported_once(kernel: Any, content: bytes | None) -> Iterator[None]:
    """Report a compilation, unless it is a part of another one of this thread, or on disk."""
    is_outermost = not getattr(_thread, "is_compiling", False)
    if content is not None or not is_outermost:
        yield
        return
    _thread.is_compiling = True
    try:
        with reported(qualified_name(kernel)):
            yield
    finally:
        _thread.is_compiling = False
