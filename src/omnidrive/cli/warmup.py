"""``omnidrive warmup``: compile all numerical kernels."""

from __future__ import annotations

from typing import Annotated

from omnidrive.cli.options import available_cores, flag
from omnidrive.cli.terminal import show


def warmup(
    clear: Annotated[
        bool,
        flag("Remove the compiled kernels, as before `pip uninstall omnidrive`.", None, "--clear"),
    ] = False,
) -> None:
    """Compile all numerical kernels in advance.

    The compiled kernels are kept on disk, and a new version of omnidrive compiles only those that
    changed. Without this command, each kernel is compiled at its first use. Their folder is beside
    the package or in `~/.cache`; the environment variable NUMBA_CACHE_DIR chooses another one. It
    must belong to you, and others must not be able to write to it. `pip uninstall` leaves it;
    `--clear` removes it.
    """
    from omnidrive.compiled.cache_folder import usable_folder

    folder = usable_folder()
    if clear:
        count = folder.clear() if folder else 0
        show(f"{count} compiled kernels removed{f' from {folder.path}' if folder else ''}")
        return
    from omnidrive.cli.progress import LiveProgress
    from omnidrive.study import warm_up

    with LiveProgress() as progress:
        warm_up(progress, processes=available_cores())
    show(
        "all kernels are compiled" + (f" and kept in {folder.path}" if folder else ", but not kept")
    )
