"""Tables of inputs in CSV files, evaluated block by block: a million rows in little memory."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
import pyarrow as pa
from jaxtyping import Float
from pyarrow import csv as arrow

from omnidrive.arrays import Array
from omnidrive.errors import CannotWrite, InvalidInput, suggestion
from omnidrive.files.bounded_file import one_line, short_repr
from omnidrive.fuzzy.inference import Inference

MAX_LINE = 1_000_000
"""Most bytes of one line."""

_BLOCK = 8_000_000  # bytes read at a time
_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)


class Evaluated(NamedTuple):
    """What became of a table."""

    rows: int
    unused: tuple[str, ...]
    """Columns that name no input."""


class _Block(NamedTuple):
    """Some whole lines of a file."""

    first_line: int
    """Number of the first, from 1."""
    data: bytes


def evaluate_csv(
    inference: Inference, source: Path, target: Path, *, threads: int = 1
) -> Evaluated:
    """Evaluate a system for every row of a CSV file and write another.

    The columns of ``source`` are named after the inputs, in any order; others are left alone, and
    so are empty lines. Those of ``target`` are the outputs, each followed by NAME_lower and
    NAME_upper in a system of type 2 or 3; every number is written so that the same one is read.

    Args:
        inference: The system.
        source: Comma-separated, in UTF-8, with one line of headings.
        target: Replaced when the last row is done; untouched if any is refused.
        threads: How many processor cores to use; changes no number.

    Raises:
        InvalidInput: The file cannot be read, a column is missing, or a value is; the message
            says in which line and column.
        CannotWrite: There is no room, or no permission.
    """
    name = one_line(str(source))
    rows = 0
    try:
        with source.open("rb") as stream:
            blocks = _blocks(stream)
            columns, unused = _columns(next(blocks, _Block(1, b"")), inference)
            headings = _headings(inference)
            with _whole(target) as out:
                with _writing(target):
                    out.write(headings)
                for block in blocks:
                    inputs = _inputs(block, columns)
                    found = _evaluated(inference, inputs, block, threads)
                    with _writing(target):
                        _write_rows(out, found, inference)
                    rows += len(inputs)
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from None
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        reason = getattr(error, "strerror", None) or error
        raise InvalidInput(f"{name}: cannot be read: {reason}") from None
    return Evaluated(rows, unused)


class _Columns(NamedTuple):
    names: tuple[str, ...]
    """Of all columns, in the file's order."""
    inputs: tuple[int, ...]
    """Where in the file each input stands."""


def _blocks(stream: IO[bytes]) -> Iterator[_Block]:
    """The first line of a file, then the others, many at a time."""
    line = stream.readline(MAX_LINE + 1).removeprefix(b"\xef\xbb\xbf")
    if len(line) > MAX_LINE:
        raise InvalidInput(f"line 1 is longer than {MAX_LINE} bytes, the most that is read")
    yield _Block(1, line)
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
    """Where the inputs stand, by the first line; and which columns are none."""
    try:
        text = block.data.decode("utf-8")
    except UnicodeDecodeError:
        raise InvalidInput("line 1: expected the names of columns in UTF-8") from None
    names = tuple(name.strip() for name in _fields(text, 1))
    wanted = [variable.name for variable in inference.system.inputs]
    if not any(names):
        raise InvalidInput(f"line 1: expected the columns {', '.join(wanted)}, got an empty line")
    for name in wanted:
        if names.count(name) > 1:
            raise InvalidInput(f"line 1: the column {name!r} is there twice")
        if name not in names:
            there = suggestion(name, [one_line(each, 60) for each in names])
            if len(names) == 1 and (other := next((s for s in ";\t" if s in names[0]), None)):
                there = f"; the separator must be a comma, not {other!r}"
            raise InvalidInput(f"line 1: there is no column {name!r}{there}")
    unused = tuple(one_line(each, 60) for each in names if each not in wanted)
    return _Columns(names, tuple(map(names.index, wanted))), unused


def _inputs(block: _Block, columns: _Columns) -> Float[Array, "rows inputs"]:
    """Numbers of a block: by Arrow; where it stumbles, line by line, to say where, and why."""
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
            found = np.column_stack([table.column(key).to_numpy() for key in picked])
            if np.isfinite(found).all():
                return found
    return np.array([_numbers(*each, columns) for each in _lines(block)]).reshape(-1, len(picked))


def _is_plain(block: _Block) -> bool:
    """Whether Arrow sees the same rows as :func:`_lines`: no quotes, no lone carriage returns."""
    data = block.data
    return b'"' not in data and data.count(b"\r") == data.count(b"\r\n")


def _lines(block: _Block) -> Iterator[tuple[int, str]]:
    """Number and text of each line that is not empty."""
    for number, line in enumerate(block.data.split(b"\n"), block.first_line):
        text = line.removesuffix(b"\r").decode("utf-8", errors="replace")
        if text:
            yield number, text


def _numbers(number: int, line: str, columns: _Columns) -> list[float]:
    """Inputs in one line."""
    fields = _fields(line, number)
    if len(fields) != len(columns.names):
        raise InvalidInput(
            f"line {number}: expected {len(columns.names)} values, as in line 1, got {len(fields)}"
        )
    found = []
    for k in columns.inputs:
        where, text = f"line {number}, column {columns.names[k]!r}", fields[k]
        if not text.strip():
            raise InvalidInput(f"{where}: expected a number, got nothing")
        if not _NUMBER.fullmatch(text) or not np.isfinite(float(text)):
            raise InvalidInput(f"{where}: expected a finite number, got {short_repr(text)}")
        found.append(float(text))
    return found


def _fields(line: str, number: int) -> list[str]:
    """Values of one line; a quoted value ends on it."""
    try:
        return next(csv.reader([line.rstrip("\r\n")], strict=True), [])
    except csv.Error as error:
        raise InvalidInput(f"line {number}: is not comma-separated values: {error}") from None


def _evaluated(
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


def _headings(inference: Inference) -> bytes:
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
            raise InvalidInput(f"two output columns would be called {name!r}; rename an output")
    return ",".join(
        f'"{name.replace(chr(34), 2 * chr(34))}"' if re.search(r'[",]', name) else name
        for name in names
    ).encode() + b"\n"  # fmt: skip


def _write_rows(
    out: IO[bytes], found: Float[Array, "3 rows outputs"], inference: Inference
) -> None:
    """Append rows; Arrow writes the shortest text from which the same number is read."""
    if not found.shape[1]:
        return
    several = 3 if inference.system.type > 1 else 1
    columns = [
        pa.array(np.ascontiguousarray(found[k, :, o]))
        for o in range(found.shape[2])
        for k in range(several)
    ]
    table = pa.table(columns, names=[str(k) for k in range(len(columns))])
    arrow.write_csv(table, out, arrow.WriteOptions(include_header=False))


@contextmanager
def _whole(target: Path) -> Iterator[IO[bytes]]:
    """A stream whose content takes the place of ``target`` when all of it is there."""
    with _writing(target):
        part = target.with_name(f".{target.name}.{os.getpid()}.part")
        stream = part.open("wb")
    try:
        with stream:
            yield stream
            with _writing(target):
                stream.flush()
        with _writing(target):
            part.replace(target)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def _writing(target: Path) -> Iterator[None]:
    """Turn the system's errors into :class:`CannotWrite`."""
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        reason = getattr(error, "strerror", None) or error
        raise CannotWrite(f"cannot write {one_line(str(target))}: {reason}") from None
