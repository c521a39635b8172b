"""``omnidrive warmup``: compile all numerical kernels."""

from __future__ import annotations

from omnidrive.cli.options import available_cores
from omnidrive.cli.terminal import show


def warmup() -> None:
    """Compile all numerical kernels in advance.

    The compiled kernels are kept on disk, and a new version of omnidrive compiles only those that
    changed. Without this command, each kernel is compiled at its first use. Their folder is beside
    the package or in `~/.cache`; the environment variable NUMBA_CACHE_DIR chooses another one. It
    must belong to you, and others must not be able to write to it.
    """
    from omnidrive.cli.progress import LiveProgress
    from omnidrive.study import warm_up

    with LiveProgress() as progress:
        warm_up(progress, processes=available_cores())
    show("all kernels are compiled and cached")
