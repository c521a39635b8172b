"""What a terminal shows while a study works, and after."""

from __future__ import annotations

import os
from collections.abc import Sequence
from types import TracebackType
from typing import Literal

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable

from omnidrive.compiled import kernels_are_kept
from omnidrive.evaluation import Table
from omnidrive.study import Study

_WIDTH_OF_FILES = 160  # characters; the widest table fits
_SENTENCE = 30  # characters of a line of a sentence, at least


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
        what = "" if kernels_are_kept() else "compiling, the first time only"
        self._task = self._progress.add_task(name, total=steps or None, what=what)

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
    """Draw tables on standard output; what is too wide goes on below, under the same keys."""
    console = Console()
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console = Console(width=_WIDTH_OF_FILES)
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
    """Say what happened in tracking runs and step responses: faults, findings, what was done."""
    console = Console()
    for result in study.results.runs:
        if result.run.events:
            facts = "\n".join(f"  {e.t:6.2f} s  {e.what}" for e in result.run.events)
            console.print(f"{result.name}:\n{facts}", markup=False, highlight=False)


def warn_of_collisions(study: Study) -> None:
    """Say on standard error which robots ran into an obstacle, or would have."""
    if study.collisions:
        times = (f"{name} ({count} times)" for name, count in study.collisions.items())
        Console(stderr=True).print(
            f"These robots ran into an obstacle: {', '.join(times)}.",
            markup=False, highlight=False,
        )  # fmt: skip
    if study.touching:
        Console(stderr=True).print(
            f"These robots would have touched an obstacle: {', '.join(study.touching)}.",
            markup=False, highlight=False,
        )  # fmt: skip


def _split(table: Table, width: int) -> list[list[int]]:
    """Columns of each part that fits ``width`` characters; every part repeats the keys."""
    needed = [3 + _least(table, i) for i in range(len(table.columns))]
    keys = list(range(table.keys))
    parts = [[*keys]]
    for i in range(table.keys, len(needed)):
        part = parts[-1]
        if len(part) > len(keys) and 1 + sum(needed[k] for k in part) + needed[i] > width:
            parts.append([*keys])
        parts[-1].append(i)
    return parts


def _least(table: Table, i: int) -> int:
    """Characters that column ``i`` cannot do without: its longest cell, or word of its heading.

    Sentences are broken.
    """
    least = max(map(len, [*table.columns[i].split(), *(row[i] for row in table.rows)]))
    return min(least, _SENTENCE) if _is_prose(table, i) else least


def _is_prose(table: Table, i: int) -> bool:
    return table.prose and i == len(table.columns) - 1


def _fill(drawn: RichTable, table: Table, columns: list[int], *, tight: bool) -> None:
    """Add columns, and the rows that say something in them, with rules between the first keys."""
    for i in columns:
        words = i < table.keys or _is_prose(table, i)
        side: Literal["left", "right"] = "left" if words else "right"
        least = _least(table, i)
        most = least if tight and not _is_prose(table, i) else None
        drawn.add_column(table.columns[i], justify=side, min_width=least, max_width=most)
    grouped = len({row[0] for row in table.rows}) < len(table.rows)
    rows = [row for row in table.rows if any(row[i] for i in columns[table.keys :])]
    for previous, row in zip((None, *rows), rows, strict=False):
        if grouped and previous is not None and row[0] != previous[0]:
            drawn.add_section()
        drawn.add_row(*(row[i] for i in columns))
