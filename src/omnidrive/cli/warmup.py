"""The verb ``warmup``."""

from __future__ import annotations

import typer

from omnidrive.cli.progress import LiveProgress
from omnidrive.study import warm_up


def warmup() -> None:
    """Compile all numerical kernels now, so that nothing has to wait for them later.

    It takes a minute or two, once per version of omnidrive and processor; what is compiled is kept
    on disk. Without it every kernel is compiled when it is first used.
    """
    with LiveProgress() as progress:
        warm_up(progress)
    typer.echo("all kernels are compiled and kept")
