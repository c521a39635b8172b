"""Progress display in a terminal."""

from __future__ import annotations

import sys
from math import isfinite
from pathlib import Path
from time import monotonic

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
from omnidrive.cli.terminal import encodable, escaped, is_quiet
from omnidrive.study.progress import RunProgress
from omnidrive_command import check_interrupted

_LINES_EVERY = 10.0  # s between two lines about runs that are not on a terminal


class _Steps(MofNCompleteColumn):
    """Completed and total number of steps of a part; empty while the total is unknown."""

    def render(self, task: Task) -> Text:
        """Return the text of the column."""
        return super().render(task) if task.total else Text()


class LiveProgress:
    """A progress listener that draws one bar per part on standard error; none with ``--quiet``.

    If standard error is no terminal, runs are reported by plain lines, too. Use it in a ``with``
    statement. Its methods raise KeyboardInterrupt again if other code has caught the one that a
    signal raised.
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
        self._next_line = monotonic() + _LINES_EVERY

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

    def runs(self, progress: RunProgress) -> None:
        """Set the bar to the number of stored runs; show estimates beside it."""
        check_interrupted()
        self._progress.update(
            self._task,
            total=progress.total,
            completed=progress.done,
            what=escaped(", ".join(_estimates(progress))),
        )
        if monotonic() >= self._next_line:
            self._next_line = monotonic() + _LINES_EVERY
            self._print(runs_text(progress))

    def note(self, text: str) -> None:
        """Show a line about a stop rule."""
        check_interrupted()
        self._progress.update(self._task, what=escaped(text))
        self._print(text)

    def _print(self, text: str) -> None:
        """Print a line if standard error is no terminal, unless the output is quiet."""
        if not (self._progress.console.is_terminal or is_quiet()):
            print(encodable(text, sys.stderr.encoding), file=sys.stderr, flush=True)

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


def runs_text(progress: RunProgress) -> str:
    """Return the progress of runs as one line."""
    share = 100.0 * progress.done / max(progress.total, 1)
    count = f"{progress.done:,} of {progress.total:,} runs ({share:.0f} %)"
    return ", ".join([count, *_estimates(progress)])


def _estimates(progress: RunProgress) -> list[str]:
    """Return failures, remaining time and best controller, as far as there are any."""
    parts = []
    if progress.unfinished:
        parts.append(f"{progress.unfinished:,} ended early")
    if progress.done < progress.total and isfinite(progress.remaining):
        parts.append(f"{_duration_text(progress.remaining)} left")
    if progress.best:
        name, mean = progress.best
        parts.append(f"best so far: {name}, mean ME {1e3 * mean:.3g} mm")
    return parts


def _duration_text(seconds: float) -> str:
    """Return a time such as 45 s, 12 min or 3 h 20 min."""
    minutes = round(seconds / 60.0)
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"


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
