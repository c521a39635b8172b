"""``omnidrive warmup``: compile all numerical kernels."""

from __future__ import annotations

import typer

from omnidrive.cli.progress import LiveProgress
from omnidrive.study import warm_up


def warmup() -> None:
    """Compile all numerical kernels in advance.

    Compilation takes one to two minutes, once per version of omnidrive and processor; the compiled
    kernels are cached on disk. Without this command, each kernel is compiled at its first use.
    """
    with LiveProgress() as progress:
        warm_up(progress)
    typer.echo("all kernels are compiled and cached")
