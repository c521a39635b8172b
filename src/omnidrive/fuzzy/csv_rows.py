"""Evaluation of tables of inputs, in blocks of rows of bounded memory."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Generator, Iterator
from contextlib import closing
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
import pyarrow as pa
from jaxtyping import Float
from pyarrow import csv as arrow

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, one_line, short_repr, suggestion
from omnidrive.files.bounded_file import open_file
from omnidrive.files.number_table import COMMENT, TableFormat, is_index, table_format
from omnidrive.files.output_file import output_file
from omnidrive.fuzzy.inference import Inference

MAX_LINE = 1_000_000
"""Maximum number of bytes of a line."""

_BLOCK = 8_000_000  # bytes read at once
_MAX_HEAD = 1000  # lines, from the first on, that contain the titles and two rows


class EvaluatedTable(NamedTuple):
    """Result of :func:`evaluate_csv`."""

    rows: int
    """Number of rows written."""
    unused: tuple[str, ...]
    """Columns of the source that are not inputs."""
    outside: int
    """Rows with an input out of its range."""


class _Block(NamedTuple):
    """Consecutive complete lines of a file."""

    first_line: int
    """Number of the first line, from 1."""
    data: bytes


def evaluate_csv(
    inference: Inference, source: Path, target: Path, *, threads: int = 1
) -> EvaluatedTable:
    """Evaluate a system for every row of a table and write the outputs to a CSV file.

    The columns of ``source`` have the names of the inputs, in any order; other columns, comments
    and empty lines are ignored. Its first lines determine separator, decimal sign and titles, see
    :mod:`omnidrive.files.number_table`. The columns of ``target`` are the outputs, each followed by
    NAME_lower and NAME_upper in a system of type 2 or 3. Every number is written with the digits
    that are needed to read the same number.

    Args:
        inference: The compiled system.
        source: Table in UTF-8 with titles.
        target: File to write; it is replaced only when all rows are written.
        threads: Number of threads; does not change the results.

    Raises:
        InvalidInput: The source cannot be read, or a column or value is missing or invalid; the
            message names the line and the column.
        CannotWrite: The target cannot be written.
    """
    rows = outside = 0
    with closing(_blocks(source)) as blocks:
        try:
            first = next(blocks, _Block(1, b""))
            columns, unused = _columns(first, inference)
            rest = _Block(columns.form.first_row, _without(first.data, columns.form.first_row - 1))
            header = _header(inference)
            with output_file(target) as part, part.open("wb") as out:
                out.write(header)
                for block in chain([rest] if rest.data else [], blocks):
                    inputs = _inputs(block, columns)
                    _write_rows(out, _evaluate(inference, inputs, block, threads), inference)
                    rows += len(inputs)
                    outside += _count_outside(inputs, inference)
        except InvalidInput as error:
            raise InvalidInput(f"{one_line(str(source))}: {error}") from None
    return EvaluatedTable(rows, unused, outside)


class _Columns(NamedTuple):
    """Columns of the source."""

    names: tuple[str, ...]
    """Names of all columns of the file."""
    inputs: tuple[int, ...]
    """Index of the column of each input."""
    form: TableFormat
    """Separator, decimal sign and first lines."""


def _blocks(source: Path) -> Generator[_Block, None, None]:
    """Yield blocks of lines."""
    with open_file(source, "inputs", InvalidInput) as stream:
        number = 1
        while data := stream.read(_BLOCK):
            rest = stream.readline(MAX_LINE + 1)
            if len(rest) > MAX_LINE:
                number += data.count(b"\n")
                raise InvalidInput(f"line {number} is longer than {MAX_LINE} bytes")
            data += rest
            if b"\0" in data:
                number += data[: data.index(b"\0")].count(b"\n")
                raise InvalidInput(f"line {number}: expected text, got a NUL character")
            yield _Block(number, data)
            number += data.count(b"\n")


def _without(data: bytes, lines: int) -> bytes:
    """Return the data without its first lines."""
    for _ in range(lines):
        data = data[data.find(b"\n") + 1 :] if b"\n" in data else b""
    return data


def _columns(block: _Block, inference: Inference) -> tuple[_Columns, tuple[str, ...]]:
    """Return the columns that the titles name, and the names that are not inputs."""
    lines = block.data.removeprefix(BOM_UTF8).split(b"\n", _MAX_HEAD)[:_MAX_HEAD]
    for number, line in enumerate(lines, 1):
        if len(line) > MAX_LINE:
            raise InvalidInput(f"line {number} is longer than {MAX_LINE} bytes")
    try:
        form = table_format([each.decode(errors="replace") for each in lines])
    except ValueError as error:
        raise InvalidInput(f"the titles: {error}") from None
    names, expected = form.titles, [variable.name for variable in inference.system.inputs]
    where = f"line {form.title_line or 1}"
    if not any(names):
        found = "numbers" if form.first_row <= len(lines) else "an empty line"
        raise InvalidInput(f"{where}: expected the columns {', '.join(expected)}, got {found}")
    if "\ufffd" in "".join(names):
        raise InvalidInput(f"{where}: expected column names in UTF-8")
    for name in expected:
        if names.count(name) > 1:
            raise InvalidInput(f"{where}: the column {name!r} appears twice")
        if name not in names:
            raise InvalidInput(f"{where}: there is no column {name!r}{suggestion(name, names)}")
    unused = [each for each in names if each not in expected and not is_index(each)]
    columns = _Columns(names, tuple(map(names.index, expected)), form)
    return columns, tuple(one_line(each, 60) for each in unused)


def _inputs(block: _Block, columns: _Columns) -> Float[Array, "rows inputs"]:
    """Return the inputs of a block; after an error of Arrow, parse by line to locate the error."""
    keys = [str(k) for k in range(len(columns.names))]
    picked = [keys[k] for k in columns.inputs]
    if _is_plain(block, columns.form):
        try:
            table = arrow.read_csv(
                BytesIO(block.data),
                arrow.ReadOptions(use_threads=False, column_names=keys, block_size=len(block.data)),
                arrow.ParseOptions(delimiter=columns.form.separator, ignore_empty_lines=True),
                arrow.ConvertOptions(
                    include_columns=picked,
                    column_types=dict.fromkeys(picked, pa.float64()),
                    null_values=[],
                    decimal_point=columns.form.decimal,
                ),
            )
        except pa.ArrowInvalid:
            pass
        else:
            inputs = np.column_stack([table.column(key).to_numpy() for key in picked])
            if np.isfinite(inputs).all():
                return inputs
    return np.array([_numbers(*each, columns) for each in _lines(block)]).reshape(-1, len(picked))


def _is_plain(block: _Block, form: TableFormat) -> bool:
    """Return whether Arrow reads the same rows as :func:`_lines`.

    Several blanks as one separator, comments, quotes and carriage returns without line feeds may be
    read differently.
    """
    data = block.data
    special = form.separator == " " or b'"' in data or COMMENT.encode() in data
    return not special and data.count(b"\r") == data.count(b"\r\n")


def _lines(block: _Block) -> Iterator[tuple[int, str]]:
    """Yield the number and the text of each line that is not empty or a comment."""
    for number, line in enumerate(block.data.split(b"\n"), block.first_line):
        text = line.removesuffix(b"\r").decode("utf-8", errors="replace")
        if text.strip() and not text.lstrip().startswith(COMMENT):
            yield number, text


def _numbers(number: int, line: str, columns: _Columns) -> list[float]:
    """Return the inputs of one line."""
    form = columns.form
    try:
        cells = form.cells(line)
    except ValueError as error:
        raise InvalidInput(f"line {number}: {error}") from None
    if len(cells) != len(columns.names):
        raise InvalidInput(
            f"line {number}: expected {len(columns.names)} values, as in line {form.title_line}, "
            f"got {len(cells)}"
        )
    found = []
    for k in columns.inputs:
        where, text = f"line {number}, column {columns.names[k]!r}", cells[k]
        if not text:
            raise InvalidInput(f"{where}: expected a number, got an empty field")
        value = form.number(text)
        if value is None:
            raise InvalidInput(f"{where}: expected a finite number, got {short_repr(text)}")
        found.append(value)
    return found


def _evaluate(
    inference: Inference, inputs: Float[Array, "rows inputs"], block: _Block, threads: int
) -> Float[Array, "3 rows outputs"]:
    try:
        return inference.batch(inputs, threads=threads)
    except InvalidInput:
        for (line, _), row in zip(_lines(block), inputs.tolist(), strict=True):
            try:
                inference.interval(*row)
            except InvalidInput as error:
                raise InvalidInput(f"line {line}: {error}") from None
        raise


def _count_outside(inputs: Float[Array, "rows inputs"], inference: Inference) -> int:
    """Return the number of rows with an input out of its range."""
    low, high = np.array([(each.low, each.high) for each in inference.system.inputs]).T
    return int(((inputs < low) | (inputs > high)).any(axis=1).sum())


def _header(inference: Inference) -> bytes:
    names = [
        name
        for output in inference.system.outputs
        for name in (
            (output.name, f"{output.name}_lower", f"{output.name}_upper")
            if inference.system.type > 1
            else (output.name,)
        )
    ]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInput(f"two output columns would have the name {name!r}; rename an output")
    return ",".join(
        f'"{name.replace(chr(34), 2 * chr(34))}"' if re.search(r'[",]', name) else name
        for name in names
    ).encode() + b"\n"  # fmt: skip


def _write_rows(
    out: IO[bytes], results: Float[Array, "3 rows outputs"], inference: Inference
) -> None:
    """Append rows; Arrow writes the shortest text that reads as the same number."""
    if not results.shape[1]:
        return
    count = 3 if inference.system.type > 1 else 1
    columns = [
        pa.array(np.ascontiguousarray(results[k, :, o]))
        for o in range(results.shape[2])
        for k in range(count)
    ]
    table = pa.table(columns, names=[str(k) for k in range(len(columns))])
    arrow.write_csv(table, out, arrow.WriteOptions(include_header=False))
