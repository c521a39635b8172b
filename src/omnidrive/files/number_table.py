"""Tables of numbers in text files: separator, decimal sign, titles and cells."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

from omnidrive.errors import one_line
from omnidrive.files.number_text import parse_number

COMMENT = "#"
"""First character of a comment, which may contain the titles."""

_SEPARATORS = (";", "\t", ",")
_INDEX = re.compile(r"(Unnamed: *\d+)?")  # titles that pandas writes for or gives to an index
_DECIMAL_ROWS = 1000  # in which a decimal sign is looked for
_QUOTED = re.compile(r'"[^"]*"')


class TableFormat(NamedTuple):
    """Format of a table of numbers."""

    separator: str
    """Character between cells; a blank stands for any number of blanks."""
    decimal: str
    """Decimal sign: a point, or a comma where the separator is another character."""
    titles: tuple[str, ...]
    """Titles of the columns; none if no line contains them."""
    title_line: int
    """Number of the line of the titles, from 1; 0 if there is none."""
    first_row: int
    """Number of the line of the first row, from 1; after the last line if there is none."""

    def cells(self, line: str) -> list[str]:
        """Return the cells of a row without blanks and quotes around them.

        Raises:
            ValueError: A quote is not closed.
        """
        return split_cells(line, self.separator)

    def number(self, cell: str) -> float | None:
        """Return the number in a cell, None for any other text."""
        return parse_number(cell.replace(",", ".") if self.decimal == "," else cell)


def table_format(lines: Sequence[str]) -> TableFormat:
    """Return the format of a table from its first lines.

    The separator is the semicolon, tab or comma, in this order, that the first line besides
    comments contains, and otherwise blanks. If that line consists of numbers, the titles are those
    of the last comment before it with as many cells, else there are none. Otherwise its cells are
    the titles; a table without rows may have them in a comment. The decimal sign is that of the
    first number with one.

    Args:
        lines: Lines of the file, at least up to the second row and to a number with a decimal sign.

    Raises:
        ValueError: A quote is not closed.
    """
    comments = []
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if text.startswith(COMMENT):
            comments.append((number, text.lstrip(COMMENT).strip()))
        elif text.strip('",;'):
            separator = table_separator(line)
            cells = split_cells(line, separator)
            if not _is_row(cells, separator):
                decimal = _decimal(lines[number:], separator)
                return TableFormat(separator, decimal, tuple(cells), number, number + 1)
            at, titles = _titles(comments, len(cells))
            return TableFormat(
                separator, _decimal(lines[number - 1 :], separator), titles, at, number
            )
    return TableFormat(",", ".", (), 0, len(lines) + 1)


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line; see :meth:`TableFormat.cells`."""
    if separator == " ":
        return [cell.strip('"') for cell in line.split()]
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        reader = csv.reader([line.rstrip("\r\n")], delimiter=separator, skipinitialspace=True,
                            strict=True)  # fmt: skip
        return [cell.strip() for cell in next(reader, [])]
    except csv.Error as error:
        raise ValueError(one_line(str(error))) from None  # may hold the separator


def is_index(title: str) -> bool:
    """Whether a title is that of an index column of pandas: empty or ``Unnamed: 0``."""
    return _INDEX.fullmatch(title) is not None


def _has_cells(line: str) -> bool:
    return bool(line.strip('",; \t\r\n')) and not line.lstrip().startswith(COMMENT)


def table_separator(line: str) -> str:
    """Return the separator of a line, see :func:`table_format`; quoted cells do not count."""
    plain = _QUOTED.sub("", line)
    found = next((each for each in _SEPARATORS if each in plain), None)
    return found or (" " if len(plain.split()) > 1 else ",")


def _decimal(lines: Sequence[str], separator: str) -> str:
    """Return the sign in the first number that has one; a point if none has."""
    if separator == ",":
        return "."
    for line in islice(filter(_has_cells, lines), _DECIMAL_ROWS):
        for cell in line.replace('"', "").split(None if separator == " " else separator):
            sign = next((each for each in ",." if each in cell), None)
            if sign and parse_number(cell.replace(",", ".")) is not None:
                return sign
    return "."


def _is_row(cells: list[str], separator: str) -> bool:
    """Whether every cell is a number or empty, and one is a number."""
    numbers = [parse_number(c.replace(",", ".") if separator != "," else c) for c in cells if c]
    return bool(numbers) and None not in numbers


def _titles(comments: list[tuple[int, str]], count: int) -> tuple[int, tuple[str, ...]]:
    """Return line and titles of the last comment with as many cells as the table."""
    for number, text in reversed(comments):
        cells = split_cells(text, table_separator(text)) if '"' not in text else []
        if len(cells) == count and not text.lower().startswith("units:"):
            return number, tuple(cells)
    return 0, ()
