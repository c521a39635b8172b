"""A table of text cells, independent of its output format."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """A table of formatted text cells.

    Attributes:
        title: Title.
        columns: Heading of each column, with its unit.
        rows: Cells of each row.
        note: Text below the table; may be empty.
        keys: Number of leading columns that identify a row.
        prose: Whether the last column contains sentences, which may be wrapped.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    keys: int = 1
    prose: bool = False
