"""Progress display and result tables in a terminal."""

from __future__ import annotations

import os
from collections.abc import Sequence
from types import TracebackType
from typing import Literal

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable

from omnidrive.cli.terminal import is_quiet
from omnidrive.evaluation import Table
from omnidrive.study import Study

_FILE_WIDTH = 160  # characters; the tables of a study with one seed fit
_SENTENCE_WIDTH = 30  # characters; minimum of a column with sentences


class LiveProgress:
    """A progress listener that draws one bar per part on standard error."""

    def __init__(self) -> None:
        self._progress = Progress(
            TextColumn("{task.description:<9}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[what]}", style="dim"),
            console=Console(stderr=True),
            disable=is_quiet(),
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
        """Start the bar of a part."""
        self._finish()
        self._task = self._progress.add_task(name, total=steps or None, what="")

    def done(self, what: str) -> None:
        """Advance the bar by one step."""
        self._progress.update(self._task, advance=1, what=what)

    def _finish(self) -> None:
        task = self._progress.tasks[-1]
        if task.total is None:
            self._progress.update(task.id, total=task.completed)
        self._progress.stop_task(task.id)
        self._progress.update(task.id, what="")


def print_tables(tables: Sequence[Table]) -> None:
    """Print tables on standard output; columns that do not fit follow below, with the keys."""
    if is_quiet():
        return
    console = Console()
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console = Console(width=_FILE_WIDTH)
    for table in tables:
        parts = _split(table, console.width)
        for part in parts:
            last = part is parts[-1]
            drawn = RichTable(
                title=table.title if part is parts[0] else f"{table.title} (continued)",
                title_justify="left",
                caption=table.note if last and table.note else None,
                caption_justify="left",
            )
            _fill(drawn, table, part, tight=len(parts) > 1)
            console.print(drawn)
        console.print()


def print_events(study: Study) -> None:
    """Print the events of tracking runs and step responses: faults, detections and reactions."""
    console = Console(quiet=is_quiet())
    for result in study.results.runs:
        if result.run.events:
            lines = "\n".join(f"  {e.t:6.2f} s  {e.what}" for e in result.run.events)
            console.print(f"{result.name}:\n{lines}", markup=False, highlight=False)


def warn_of_collisions(study: Study) -> None:
    """Print on standard error which runs collided with an obstacle, or overlapped one."""
    if study.collisions:
        counts = (f"{name} ({count})" for name, count in study.collisions.items())
        Console(stderr=True, quiet=is_quiet()).print(
            f"Runs with collisions: {', '.join(counts)}.",
            markup=False, highlight=False,
        )  # fmt: skip
    if study.overlaps:
        Console(stderr=True, quiet=is_quiet()).print(
            f"Runs in which the robot overlaps an obstacle: {', '.join(study.overlaps)}.",
            markup=False, highlight=False,
        )  # fmt: skip


def _split(table: Table, width: int) -> list[list[int]]:
    """Split the columns into parts of at most ``width`` characters; each part repeats the keys."""
    needed = [3 + _min_width(table, i) for i in range(len(table.columns))]
    keys = list(range(table.keys))
    parts = [[*keys]]
    for i in range(table.keys, len(needed)):
        part = parts[-1]
        if len(part) > len(keys) and 1 + sum(needed[k] for k in part) + needed[i] > width:
            parts.append([*keys])
        parts[-1].append(i)
    return parts


def _min_width(table: Table, i: int) -> int:
    """Return the minimum width of column ``i``: its longest cell or heading word, in characters.

    Sentences can be wrapped to a smaller width.
    """
    least = max(map(len, [*table.columns[i].split(), *(row[i] for row in table.rows)]))
    return min(least, _SENTENCE_WIDTH) if _is_prose(table, i) else least


def _is_prose(table: Table, i: int) -> bool:
    return table.prose and i == len(table.columns) - 1


def _fill(drawn: RichTable, table: Table, columns: list[int], *, tight: bool) -> None:
    """Add columns and the rows with values in them, with a rule between groups of the first key."""
    for i in columns:
        words = i < table.keys or _is_prose(table, i)
        side: Literal["left", "right"] = "left" if words else "right"
        least = _min_width(table, i)
        most = least if tight and not _is_prose(table, i) else None
        drawn.add_column(table.columns[i], justify=side, min_width=least, max_width=most)
    grouped = len({row[0] for row in table.rows}) < len(table.rows)
    rows = [row for row in table.rows if any(row[i] for i in columns[table.keys :])]
    for previous, row in zip((None, *rows), rows, strict=False):
        if grouped and previous is not None and row[0] != previous[0]:
            drawn.add_section()
        drawn.add_row(*(row[i] for i in columns))
