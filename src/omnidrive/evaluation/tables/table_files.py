"""LaTeX and CSV files of tables."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from io import StringIO
from pathlib import Path

from omnidrive.evaluation.tables.table import NEGLIGIBLE, NO_VALUE, Table
from omnidrive.files.output_file import create_folder, output_file
from omnidrive.files.str_path import StrPath, to_path

_PLUS_MINUS = " ± "
_LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#",
    "%": r"\%", "_": r"\_", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}",
    "<": "$<$", ">": "$>$", "\N{MINUS SIGN}": "$-$", "±": r"$\pm$", "µ": r"$\mu$", "²": "$^2$",
    NO_VALUE: "--", "→": r"$\to$",
}  # fmt: skip


def write_tables(tables: Iterable[Table], folder: StrPath) -> Iterator[Path]:
    """Write every table as ``.tex`` and ``.csv``.

    Args:
        tables: The tables.
        folder: Output folder; created if it does not exist.

    Yields:
        Path of each file after it is written.

    Raises:
        CannotWrite: A file cannot be written.
    """
    folder = to_path(folder)
    create_folder(folder)
    for table in tables:
        for suffix, text in ((".tex", latex_text(table)), (".csv", csv_text(table))):
            path = folder / f"{table.stem}{suffix}"
            with output_file(path) as part:
                part.write_text(text, encoding="utf-8", errors="backslashreplace", newline="")
            yield path


def latex_text(table: Table) -> str:
    """Return a LaTeX table for the package booktabs; the best cells are bold.

    Groups of rows with the same first key are separated by half a line.
    """
    words = table.keys
    alignment = "l" * words + "r" * (len(table.columns) - words)
    if table.prose:
        alignment = alignment[:-1] + "p{5cm}"
    lines = [
        r"% needs \usepackage{booktabs}",
        r"\begin{table}",
        rf"\caption{{{_escape(table.title)}}}",
        rf"\label{{tab:{table.stem}}}",
        rf"\begin{{tabular}}{{{alignment}}}",
        r"\toprule",
        _row([_heading(name) for name in table.columns]),
        r"\midrule",
    ]
    grouped = len({row[0] for row in table.rows}) < len(table.rows)
    for k, row in enumerate(table.rows):
        if grouped and k and row[0] != table.rows[k - 1][0]:
            lines.append(r"\addlinespace")
        lines.append(
            _row(
                [
                    rf"\textbf{{{_escape(cell)}}}" if (k, i) in table.best else _escape(cell)
                    for i, cell in enumerate(row)
                ]
            )
        )
    lines += [r"\bottomrule", r"\end{tabular}"]
    lines += [rf"\par\smallskip\footnotesize {_escape(table.footnote)}"] if table.footnote else []
    return "\n".join([*lines, r"\end{table}", ""])


def csv_text(table: Table) -> str:
    """Return the table as CSV; a cell with ``±`` is two columns, a dash is an empty cell.

    A result that is negligible, in a column with a unit, is 0.
    """
    split = {
        i for i in range(len(table.columns)) if any(_PLUS_MINUS in row[i] for row in table.rows)
    }
    output = StringIO()
    writer = csv.writer(output, lineterminator="\n")
    headings = [
        [name, f"{name} (half 95 % interval)"] if i in split else [name]
        for i, name in enumerate(table.columns)
    ]
    writer.writerow([name for names in headings for name in names])
    for row in table.rows:
        numbers = [
            "0" if cell == NEGLIGIBLE and ", " in name else cell
            for name, cell in zip(table.columns, row, strict=True)
        ]
        cells = [_values(cell) if i in split else [_plain(cell)] for i, cell in enumerate(numbers)]
        writer.writerow([cell for parts in cells for cell in parts])
    return output.getvalue()


def _values(cell: str) -> list[str]:
    """Return the mean and the half width of a cell; the latter may be absent."""
    mean, _, half = cell.partition(_PLUS_MINUS)
    return [_plain(mean), _plain(half)]


def _plain(cell: str) -> str:
    """Return the cell with an ASCII minus sign; a dash, which stands for no value, is empty."""
    return "" if cell == NO_VALUE else cell.replace("\N{MINUS SIGN}", "-")


def _heading(name: str) -> str:
    """Return a heading with its unit in parentheses."""
    quantity, comma, unit = name.rpartition(", ")
    return _escape(f"{quantity} ({unit})" if comma else name)


def _row(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"


def _escape(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text)
