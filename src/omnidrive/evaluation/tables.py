"""Tables as data: the command line and the page draw the same ones."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text, ready to draw.

    Attributes:
        title: What it shows.
        columns: Heading of each column, with its unit.
        rows: Cells, row by row; the first cell of a row names it.
        note: One sentence under the table; may be empty.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
