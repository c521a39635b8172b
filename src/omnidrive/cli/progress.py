"""Progress display in a terminal."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

from omnidrive import visualization  # imports only the modules in use
from omnidrive.cli.compile_status import displays
from omnidrive.cli.terminal import is_quiet
from omnidrive_command import check_interrupted


class _Steps(MofNCompleteColumn):
    """Completed and total number of steps of a part; empty while the total is unknown."""

    def render(self, task: Task) -> Text:
        """Return the text of the column."""
        return super().render(task) if task.total else Text()


class LiveProgress:
    """A progress listener that draws one bar per part on standard error; none with ``--quiet``.

    Use it in a ``with`` statement. :meth:`part` and :meth:`done` raise KeyboardInterrupt again
    if other code has caught the one that a signal raised.
    """

    def __init__(self) -> None:
        self._progress = Progress(
            TextColumn("{task.description:<9}"),
            BarColumn(),
            _Steps(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[what]}", style="dim"),
            console=Console(stderr=True),
            disable=is_quiet(),
        )
        self._task = self._progress.add_task("", visible=False, what="")

    def __enter__(self) -> LiveProgress:
        self._progress.start()
        displays.append(self._show)
        return self

    def __exit__(self, *_: object) -> None:
        displays.remove(self._show)
        self._finish()
        self._progress.stop()

    def part(self, name: str, steps: int) -> None:
        """Start the bar of a part with ``steps`` steps (0: unknown number)."""
        check_interrupted()
        self._finish()
        self._task = self._progress.add_task(name, total=steps or None, what="")

    def done(self, what: str) -> None:
        """Advance the bar by one step and show its name ``what`` beside the bar."""
        check_interrupted()
        self._progress.update(self._task, advance=1, what=what)

    def _show(self, what: str) -> None:
        """Show a text beside the bar."""
        self._progress.update(self._task, what=what)

    def _finish(self) -> None:
        """End the bar of the last part."""
        task = self._progress.tasks[-1]
        if task.total is None:
            self._progress.update(task.id, total=task.completed)
        self._progress.stop_task(task.id)
        self._progress.update(task.id, what="")


def save_film(recording: visualization.Recording, video: Path, progress: LiveProgress) -> str:
    """Write a film with a progress bar; return the path and, unless in real time, the speed.

    It raises the same errors as :func:`~omnidrive.visualization.film`.
    """

    def rendered(done: int, count: int) -> None:
        """Show that ``done`` of ``count`` pictures are drawn."""
        if done == 1:
            progress.part("video", count)
        progress.done(video.name)

    speed = visualization.film(recording, video, progress=rendered)
    return str(video) if speed == 1.0 else f"{video} ({speed:g} times real time)"
