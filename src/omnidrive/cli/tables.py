"""Result tables in a terminal."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Literal

from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from omnidrive.cli.terminal import escaped, is_quiet
from omnidrive.evaluation import Table

_FILE_WIDTH = 160  # characters; the tables of a study with one seed fit
_SENTENCE_WIDTH = 30  # characters; minimum of a column with sentences
_MARK = "*"  # before the best cell of a column, for files and terminals without bold text
_LEGEND = f"{_MARK} best in its column."


def print_tables(tables: Sequence[Table], *, full: bool = True) -> None:
    """Print tables on standard output; columns that do not fit follow below, with the keys.

    Args:
        tables: Tables to print, in this order.
        full: Whether to print all tables and columns. False: without details.
    """
    if is_quiet():
        return
    console = Console()
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console = Console(width=_FILE_WIDTH)
    shown = tables if full else [table.brief() for table in tables if not table.is_detail]
    for table in shown:
        if table.lead:
            console.print(Text(escaped(table.lead), style="bold"))
        wide = len(_split(table, console.width)) > 1
        _print(console, table.compact if wide and table.compact is not None else table)


def _print(console: Console, table: Table) -> None:
    parts = _split(table, console.width)
    for part in parts:
        drawn = RichTable(
            title=Text(escaped(table.title if part is parts[0] else f"{table.title} (continued)")),
            title_justify="left",
            caption=Text(escaped(_caption(table)))
            if part is parts[-1] and _caption(table)
            else None,
            caption_justify="left",
        )
        headings = sum(3 + max(len(table.columns[i]), _min_width(table, i)) for i in part)
        _fill(drawn, table, part, tight=1 + headings > console.width)
        console.print(drawn)
    console.print()


def _caption(table: Table) -> str:
    return " ".join(text for text in (_LEGEND if table.best else "", table.footnote) if text)


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
    cells = (_cell(table, k, i) for k in range(len(table.rows)))
    minimum = max(map(len, [*table.columns[i].split(), *cells]))
    return min(minimum, _SENTENCE_WIDTH) if _is_prose(table, i) else minimum


def _cell(table: Table, row: int, i: int) -> str:
    return (_MARK if (row, i) in table.best else "") + escaped(table.rows[row][i])


def _is_prose(table: Table, i: int) -> bool:
    return table.prose and i == len(table.columns) - 1


def _fill(drawn: RichTable, table: Table, columns: list[int], *, tight: bool) -> None:
    """Add columns and the rows with values in them, with a rule between groups of the first key.

    With ``tight``, headings are wrapped, so that the columns have their minimum widths.
    """
    for i in columns:
        words = i < table.keys or _is_prose(table, i)
        side: Literal["left", "right"] = "left" if words else "right"
        minimum = _min_width(table, i)
        maximum = minimum if tight and not _is_prose(table, i) else None
        drawn.add_column(Text(table.columns[i]), justify=side, min_width=minimum, max_width=maximum)
    grouped = len({row[0] for row in table.rows}) < len(table.rows)
    values = columns[table.keys :]  # none if all runs stopped early
    rows = [k for k, row in enumerate(table.rows) if not values or any(row[i] for i in values)]
    for previous, k in zip((None, *rows), rows, strict=False):
        if grouped and previous is not None and table.rows[k][0] != table.rows[previous][0]:
            drawn.add_section()
        cells = (
            Text(_cell(table, k, i), style="bold" if (k, i) in table.best else "") for i in columns
        )
        drawn.add_row(*cells)
