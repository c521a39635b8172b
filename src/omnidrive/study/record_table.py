"""Stored runs as tables of pyarrow."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import pyarrow as pa

_CHUNK = 10_000  # rows in memory as Python objects

_FIXED = {
    "number": pa.int64(),
    "key": pa.string(),
    "pairing": pa.int64(),
    "controller": pa.dictionary(pa.int32(), pa.string()),
    "task": pa.dictionary(pa.int32(), pa.string()),
    "duration": pa.float64(),
    "variant": pa.dictionary(pa.int32(), pa.string()),
    "repetition": pa.int64(),
    "outcome": pa.dictionary(pa.int32(), pa.string()),
    "finished": pa.bool_(),
}


def record_table(connection: sqlite3.Connection) -> pa.Table:
    """Return the table of :meth:`omnidrive.study.store.Store.records`."""
    names = [name for name in _FIXED if name != "key"]
    cursor = connection.execute(
        f"SELECT key, {', '.join(names)}, factors, metrics FROM runs JOIN results USING (key) "
        "ORDER BY number"
    )
    fixed: dict[str, list[pa.Array]] = {name: [] for name in _FIXED}
    factors, metrics = _Columns("factor:"), _Columns("", pa.float64())
    for rows in _chunks(cursor):
        for name, column in zip(("key", *names), zip(*rows, strict=True), strict=False):
            values = [bool(each) for each in column] if name == "finished" else column
            fixed[name].append(_array(values, _FIXED[name]))
        factors.add(_loaded(row[-2] for row in rows))
        metrics.add(_loaded(row[-1] for row in rows))
    columns = {name: pa.chunked_array(fixed[name], kind) for name, kind in _FIXED.items()}
    table = pa.table({**columns, **factors.arrays(), **metrics.arrays()})
    return table.unify_dictionaries()


def timing_table(connection: sqlite3.Connection) -> pa.Table:
    """Return the table of :meth:`omnidrive.study.store.Store.timing`."""
    cursor = connection.execute(
        "SELECT number, timing FROM runs JOIN results USING (key) ORDER BY number"
    )
    numbers, columns = [], _Columns("", pa.float64())
    for rows in _chunks(cursor):
        numbers.append(pa.array([number for number, _ in rows], pa.int64()))
        columns.add(_loaded(text for _, text in rows))
    return pa.table({"number": pa.chunked_array(numbers, pa.int64()), **columns.arrays()})


class _Columns:
    """Columns of values with names that differ from row to row."""

    def __init__(self, prefix: str, kind: pa.DataType | None = None) -> None:
        """Prepare columns; ``kind`` is their type, None: that of the values of each."""
        self._prefix, self._kind = prefix, kind
        self._chunks: list[tuple[int, dict[str, Any]]] = []

    def add(self, rows: Sequence[dict[str, Any]]) -> None:
        """Append rows."""
        first = tuple(rows[0])
        columns: dict[str, Sequence[Any]]
        if all(tuple(row) == first for row in rows):
            by_name = zip(*(row.values() for row in rows), strict=True)
            columns = dict(zip(first, by_name, strict=True))
        else:
            names = dict.fromkeys(name for row in rows for name in row)
            columns = {name: [row.get(name) for row in rows] for name in names}
        if self._kind is not None:
            columns = {name: pa.array(each, self._kind) for name, each in columns.items()}
        self._chunks.append((len(rows), columns))

    def arrays(self) -> dict[str, pa.ChunkedArray]:
        """Return the columns, in the order of their first values; null where a row has no value."""
        found = {}
        for name in dict.fromkeys(name for _, columns in self._chunks for name in columns):
            chunks = [columns.get(name, [None] * count) for count, columns in self._chunks]
            kind = self._kind or _kind({type(each) for chunk in chunks for each in chunk})
            arrays = [_array(chunk, kind) for chunk in chunks]
            found[self._prefix + name] = pa.chunked_array(arrays, kind)
        return found


def _loaded(texts: Iterable[str]) -> list[dict[str, Any]]:
    """Return the values of stored texts."""
    values: list[dict[str, Any]] = json.loads(f"[{','.join(texts)}]")
    return values


def _kind(kinds: set[type]) -> pa.DataType:
    """Return the type of a column with values of these types: a text if they are different."""
    kinds = kinds - {type(None)}
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int}:
        return pa.int64()
    return pa.float64() if kinds <= {int, float} else pa.string()


def _array(values: Sequence[Any] | pa.Array, kind: pa.DataType) -> pa.Array:
    """Return a column; ``kind`` text accepts all values."""
    if isinstance(values, pa.Array):
        return values
    if kind == pa.string():
        values = [each if each is None or isinstance(each, str) else str(each) for each in values]
    return pa.array(values, kind, from_pandas=False)


def _chunks(cursor: sqlite3.Cursor) -> Iterator[list[tuple[Any, ...]]]:
    """Yield the rows of a query in parts."""
    while rows := cursor.fetchmany(_CHUNK):
        yield rows
