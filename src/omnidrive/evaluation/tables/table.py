"""A table of text cells, independent of its output format."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import isfinite, nan

NO_VALUE = "–"
"""Cell of a value that does not exist."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table of formatted text cells.

    Attributes:
        title: Title, unique in a study.
        columns: Heading of each column, with its unit after a comma.
        rows: Cells of each row.
        note: Text about the whole table; may be empty.
        definitions: Heading of a column, and a text that explains it.
        keys: Number of leading columns that identify a row.
        prose: Whether the last column contains sentences, which may be wrapped.
        best: Row and column of each cell with the best value of its column.
        details: Headings of the columns that :meth:`brief` omits.
        is_detail: Whether the command line prints the table only with ``--full``.
        compact: The same content in fewer columns, for narrow terminals; None: there is none.
        lead: Result in one or two sentences, above the table; may be empty.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    definitions: tuple[tuple[str, str], ...] = ()
    keys: int = 1
    prose: bool = False
    best: frozenset[tuple[int, int]] = frozenset()
    details: frozenset[str] = frozenset()
    is_detail: bool = False
    compact: Table | None = None
    lead: str = ""

    @property
    def stem(self) -> str:
        """Title in lower case with hyphens, for the names of files."""
        return re.sub(r"[^a-z0-9]+", "-", self.title.lower()).strip("-")

    @property
    def footnote(self) -> str:
        """Text below the table: the note, and the definitions of the columns that it has."""
        explained = dict.fromkeys(text for name, text in self.definitions if name in self.columns)
        return " ".join(text for text in (self.note, *explained) if text)

    def brief(self) -> Table:
        """Return the table without the columns in :attr:`details`."""
        return self.select([i for i, name in enumerate(self.columns) if name not in self.details])

    def select(self, kept: Sequence[int]) -> Table:
        """Return the table with the columns of the given indices."""
        place = {old: new for new, old in enumerate(kept)}
        return replace(
            self,
            columns=tuple(self.columns[i] for i in kept),
            rows=tuple(tuple(row[i] for i in kept) for row in self.rows),
            keys=sum(i < self.keys for i in kept),
            prose=self.prose and len(self.columns) - 1 in place,
            best=frozenset((row, place[column]) for row, column in self.best if column in place),
        )

    def without_empty_columns(self) -> Table:
        """Return the table without the columns whose cells are all empty or dashes."""
        return self.select(
            [
                i
                for i in range(len(self.columns))
                if any(row[i] not in {"", NO_VALUE} for row in self.rows)
            ]
        )

    def mark_best(
        self, lower: Iterable[str] = (), higher: Iterable[str] = (), *, group: int | None = None
    ) -> Table:
        """Return the table with the best cells of some columns marked.

        Cells with equal text are equally good. A column whose numbers are all equal has no best.

        Args:
            lower: Headings of the columns in which the lowest number is best.
            higher: Headings of the columns in which the highest number is best.
            group: Column whose equal cells form the groups of rows that are compared; None: all
                rows are compared.
        """
        signs = {name: 1.0 for name in lower} | {name: -1.0 for name in higher}
        groups: dict[str, list[int]] = {}
        for k, row in enumerate(self.rows):
            groups.setdefault("" if group is None else row[group], []).append(k)
        best: set[tuple[int, int]] = set()
        for i, name in enumerate(self.columns):
            if name not in signs:
                continue
            for rows in groups.values():
                values = {k: signs[name] * leading_number(self.rows[k][i]) for k in rows}
                finite = [value for value in values.values() if isfinite(value)]
                if len(set(finite)) > 1:
                    best |= {(k, i) for k, value in values.items() if value == min(finite)}
        return replace(self, best=self.best | best)


def leading_number(cell: str) -> float:
    """Return the number at the start of a cell, 0 for :data:`NEGLIGIBLE`; NaN if there is none."""
    if cell == NEGLIGIBLE:
        return 0.0
    try:
        return float(cell.split(" ", 1)[0].replace("\N{MINUS SIGN}", "-"))
    except ValueError:
        return nan


RESOLUTION = 1e-6
"""Smallest magnitude that tables show, in the unit of a column: 1 nm for errors in mm.

Smaller values, such as the errors of exact tracking on the plant `kinematic`, are rounding errors.
"""


MIN_RESULT = 1e-3
"""Magnitude in mm, mrad, % or s below which a result is better than no other such result."""

NEGLIGIBLE = f"< {MIN_RESULT:g}"
"""Cell of a result below :data:`MIN_RESULT`."""


def is_negligible(value: float) -> bool:
    """Whether a result in the unit of its column equals every other such result in rankings."""
    return bool(abs(value) < MIN_RESULT)


def cell_text(value: float) -> str:
    """Format a result in the unit of its column, as :func:`number_text` or :data:`NEGLIGIBLE`."""
    is_small = abs(value) >= RESOLUTION and is_negligible(value)
    return NEGLIGIBLE if is_small else number_text(value)


def level_text(level: object) -> str:
    """Return the value of an axis as text."""
    return f"{level:g}" if isinstance(level, float) else str(level)


def number_text(value: float, digits: int = 3) -> str:
    """Format a number with at least ``digits`` significant digits, and 0 below :data:`RESOLUTION`.

    Numbers below 1e-4 and from 1e7 on are in scientific notation; a number that is not finite is a
    dash.
    """
    if not isfinite(value):
        return NO_VALUE
    if abs(value) < RESOLUTION:
        return "0"
    scientific = f"{value:.{digits - 1}e}"
    exponent = int(scientific.partition("e")[2])
    return f"{value:.{max(digits - 1 - exponent, 0)}f}" if -5 < exponent < 7 else scientific


def percent(share: float) -> str:
    """Return a share in per cent; 100 % and 0 % only if it is exact."""
    value = 100.0 * share
    digits = 0 if value in {0.0, 100.0} or 1.0 <= value <= 99.0 else 2
    return f"{value:.{digits}f} %" if isfinite(value) else "–"
