"""A table as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text, ready to draw.

    Attributes:
        title: What it shows.
        columns: Heading of each column, with its unit.
        rows: Cells, row by row.
        note: One sentence under the table; may be empty.
        keys: Leading columns that together name a row.
        prose: Whether the last column holds sentences.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    keys: int = 1
    prose: bool = False
