"""What a terminal shows while a study works, and after."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable

from omnidrive.evaluation import Table

_LEAST_WIDTH = 150  # columns that the widest table needs when nobody watches


class LiveProgress:
    """A watcher that draws one bar per part on standard error."""

    def __init__(self) -> None:
        self._progress = Progress(
            TextColumn("{task.description:<9}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[what]}", style="dim"),
            console=Console(stderr=True),
        )
        self._task = self._progress.add_task("", visible=False, what="")

    def __enter__(self) -> LiveProgress:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._finish()
        self._progress.stop()

    def part(self, name: str, steps: int) -> None:
        """Begin a bar."""
        self._finish()
        self._task = self._progress.add_task(name, total=steps or None, what="")

    def done(self, what: str) -> None:
        """Move the bar on."""
        self._progress.update(self._task, advance=1, what=what)

    def _finish(self) -> None:
        task = self._progress.tasks[-1]
        if task.total is None:
            self._progress.update(task.id, total=task.completed)
        self._progress.stop_task(task.id)
        self._progress.update(task.id, what="")


def print_tables(tables: Sequence[Table]) -> None:
    """Draw tables on standard output."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=_LEAST_WIDTH)
    for table in tables:
        drawn = RichTable(title=table.title, title_justify="left", caption=table.note or None,
                          caption_justify="left")  # fmt: skip
        for i, column in enumerate(table.columns):
            drawn.add_column(column, justify="left" if i < 2 else "right", no_wrap=i < 2)
        grouped = len({row[0] for row in table.rows}) < len(table.rows)
        previous = None
        for row in table.rows:
            if grouped and previous is not None and row[0] != previous:
                drawn.add_section()
            previous = row[0]
            drawn.add_row(*row)
        console.print(drawn)
        console.print()
