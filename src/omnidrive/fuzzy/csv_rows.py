"""Evaluation of CSV files of inputs, in blocks of rows of bounded memory."""

from __future__ import annotations

import csv
import re
from collections.abc import Generator, Iterator
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
import pyarrow as pa
from jaxtyping import Float
from pyarrow import csv as arrow

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, one_line, short_repr, suggestion
from omnidrive.files.bounded_file import open_file
from omnidrive.files.number_text import parse_number
from omnidrive.files.output_file import output_file
from omnidrive.fuzzy.inference import Inference

MAX_LINE = 1_000_000
"""Maximum number of bytes of a line."""

_BLOCK = 8_000_000  # bytes read at once


class EvaluatedTable(NamedTuple):
    """Result of :func:`evaluate_csv`."""

    rows: int
    """Number of rows written."""
    unused: tuple[str, ...]
    """Columns of the source that are not inputs."""


class _Block(NamedTuple):
    """Consecutive complete lines of a file."""

    first_line: int
    """Number of the first line, from 1."""
    data: bytes


def evaluate_csv(
    inference: Inference, source: Path, target: Path, *, threads: int = 1
) -> EvaluatedTable:
    """Evaluate a system for every row of a CSV file and write the outputs to another.

    The columns of ``source`` have the names of the inputs, in any order; other columns and empty
    lines are ignored. The columns of ``target`` are the outputs, each followed by NAME_lower and
    NAME_upper in a system of type 2 or 3. Every number is written with the digits that are needed
    to read the same number.

    Args:
        inference: The compiled system.
        source: Comma-separated file in UTF-8 with one header line.
        target: File to write; it is replaced only when all rows are written.
        threads: Number of threads; does not change the results.

    Raises:
        InvalidInput: The source cannot be read, or a column or value is missing or invalid; the
            message names the line and the column.
        CannotWrite: The target cannot be written.
    """
    rows = 0
    with closing(_blocks(source)) as blocks:
        head = next(blocks)
        try:
            columns, unused = _columns(head, inference)
            header = _header(inference)
            with output_file(target) as part, part.open("wb") as out:
                out.write(header)
                for block in blocks:
                    inputs = _inputs(block, columns)
                    _write_rows(out, _evaluate(inference, inputs, block, threads), inference)
                    rows += len(inputs)
        except InvalidInput as error:
            raise InvalidInput(f"{one_line(str(source))}: {error}") from None
    return EvaluatedTable(rows, unused)


class _Columns(NamedTuple):
    """Columns of the source."""

    names: tuple[str, ...]
    """Names of all columns of the file."""
    inputs: tuple[int, ...]
    """Index of the column of each input."""


def _blocks(source: Path) -> Generator[_Block, None, None]:
    """Yield the header line, cut after :data:`MAX_LINE` bytes, then blocks of lines."""
    with open_file(source, "inputs", InvalidInput) as stream:
        yield _Block(1, stream.readline(MAX_LINE + 1))
        number = 2
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


def _columns(block: _Block, inference: Inference) -> tuple[_Columns, tuple[str, ...]]:
    """Return the columns that the header names, and the names that are not inputs."""
    if len(block.data) > MAX_LINE:
        raise InvalidInput(f"line 1 is longer than {MAX_LINE} bytes")
    try:
        text = block.data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InvalidInput("line 1: expected column names in UTF-8") from None
    names = tuple(name.strip() for name in _fields(text, 1))
    expected = [variable.name for variable in inference.system.inputs]
    if not any(names):
        raise InvalidInput(f"line 1: expected the columns {', '.join(expected)}, got an empty line")
    for name in expected:
        if names.count(name) > 1:
            raise InvalidInput(f"line 1: the column {name!r} appears twice")
        if name not in names:
            hint = suggestion(name, names)
            if len(names) == 1 and (other := next((s for s in ";\t" if s in names[0]), None)):
                hint = f"; the separator must be a comma, not {other!r}"
            raise InvalidInput(f"line 1: there is no column {name!r}{hint}")
    unused = tuple(one_line(each, 60) for each in names if each not in expected)
    return _Columns(names, tuple(map(names.index, expected))), unused


def _inputs(block: _Block, columns: _Columns) -> Float[Array, "rows inputs"]:
    """Return the inputs of a block; after an error of Arrow, parse by line to locate the error."""
    keys = [str(k) for k in range(len(columns.names))]
    picked = [keys[k] for k in columns.inputs]
    if _is_plain(block):
        try:
            table = arrow.read_csv(
                BytesIO(block.data),
                arrow.ReadOptions(use_threads=False, column_names=keys, block_size=len(block.data)),
                arrow.ParseOptions(ignore_empty_lines=True),
                arrow.ConvertOptions(
                    include_columns=picked,
                    column_types=dict.fromkeys(picked, pa.float64()),
                    null_values=[],
                ),
            )
        except pa.ArrowInvalid:
            pass
        else:
            inputs = np.column_stack([table.column(key).to_numpy() for key in picked])
            if np.isfinite(inputs).all():
                return inputs
    return np.array([_numbers(*each, columns) for each in _lines(block)]).reshape(-1, len(picked))


def _is_plain(block: _Block) -> bool:
    """Return whether Arrow reads the same rows as :func:`_lines`.

    Quotes and carriage returns without line feeds may be read differently.
    """
    data = block.data
    return b'"' not in data and data.count(b"\r") == data.count(b"\r\n")


def _lines(block: _Block) -> Iterator[tuple[int, str]]:
    """Yield the number and the text of each line that is not empty."""
    for number, line in enumerate(block.data.split(b"\n"), block.first_line):
        text = line.removesuffix(b"\r").decode("utf-8", errors="replace")
        if text:
            yield number, text


def _numbers(number: int, line: str, columns: _Columns) -> list[float]:
    """Return the inputs of one line."""
    fields = _fields(line, number)
    if len(fields) != len(columns.names):
        raise InvalidInput(
            f"line {number}: expected {len(columns.names)} values, as in line 1, got {len(fields)}"
        )
    found = []
    for k in columns.inputs:
        where, text = f"line {number}, column {columns.names[k]!r}", fields[k]
        if not text.strip():
            raise InvalidInput(f"{where}: expected a number, got an empty field")
        value = parse_number(text)
        if value is None:
            raise InvalidInput(f"{where}: expected a finite number, got {short_repr(text)}")
        found.append(value)
    return found


def _fields(line: str, number: int) -> list[str]:
    """Return the fields of one line; a quoted field cannot contain a line break."""
    try:
        return next(csv.reader([line.rstrip("\r\n")], strict=True), [])
    except csv.Error as error:
        raise InvalidInput(f"line {number}: is not comma-separated values: {error}") from None


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
