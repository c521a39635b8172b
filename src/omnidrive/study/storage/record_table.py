"""Stored runs as tables of pyarrow."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from omnidrive.study.storage.stored_rows import Loss, loss, names_of, valid_rows

_FIXED = {
    "number": pa.int64(),
    "key": pa.string(),
    "pairing": pa.int64(),
    "controller": pa.dictionary(pa.int32(), pa.string()),
    "task": pa.dictionary(pa.int32(), pa.string()),
    "duration": pa.float64(),
    "variant": pa.dictionary(pa.int32(), pa.string()),
    "repetition": pa.int64(),
    "repeat": pa.int64(),
    "outcome": pa.dictionary(pa.int32(), pa.string()),
    "finished": pa.bool_(),
}

_READ = {"duration": float, "finished": bool}
"""Conversion of stored values."""


class StoredTables(NamedTuple):
    """Stored runs of a study."""

    records: pa.Table
    """See :meth:`omnidrive.study.storage.store.Store.records`."""
    timing: pa.Table
    """See :meth:`omnidrive.study.storage.store.Store.timing`."""
    loss: Loss
    """Stored runs that are damaged; the tables lack them."""


def stored_tables(connection: sqlite3.Connection, stored: int) -> StoredTables:
    """Return the tables of the undamaged runs.

    Args:
        connection: The database.
        stored: Number of stored runs according to the facts about the study.

    Raises:
        sqlite3.Error: The database cannot be read.
        ValueError: Stored values are invalid.
    """
    names = list(_FIXED)
    columns = ", ".join([*names[1:], "factors", "results.names", "floats"])
    fixed: dict[str, list[pa.Array]] = {name: [] for name in _FIXED}
    factors, metrics, timing = _Columns(), _Columns(), _Columns()
    for rows in valid_rows(connection, columns):
        *labels, factor_texts, name_texts, floats = zip(*rows, strict=True)
        for name, column in zip(names, labels, strict=True):
            convert = _READ.get(name)
            values = list(map(convert, column)) if convert else column
            fixed[name].append(pa.array(values, _FIXED[name], from_pandas=False))
        factors.add(len(rows), _factor_columns(factor_texts))
        of_metrics, of_timing = _float_columns(name_texts, floats)
        metrics.add(len(rows), of_metrics)
        timing.add(len(rows), of_timing)
    columns_fixed = {name: pa.chunked_array(fixed[name], kind) for name, kind in _FIXED.items()}
    by_path = {f"factor:{path}": column for path, column in factors.arrays().items()}
    table = pa.table({**columns_fixed, **by_path, **metrics.arrays()}).unify_dictionaries()
    times = pa.table({"number": columns_fixed["number"], **timing.arrays()})
    return StoredTables(table, times, loss(connection, table.num_rows, stored))


class _Columns:
    """Columns of values with names that differ from row to row.

    Parts of them are lists where their values are of several types.
    """

    def __init__(self) -> None:
        self._chunks: list[tuple[int, Mapping[str, pa.Array | list[Any]]]] = []

    def add(self, rows: int, columns: Mapping[str, pa.Array | list[Any]]) -> None:
        """Append so many rows."""
        self._chunks.append((rows, columns))

    def arrays(self) -> dict[str, pa.ChunkedArray]:
        """Return the columns, in the order of their first values; null where a row has no value."""
        found = {}
        for name in dict.fromkeys(name for _, columns in self._chunks for name in columns):
            parts = [columns.get(name, [None] * rows) for rows, columns in self._chunks]
            kind = _common({kind for part in parts for kind in _kinds(part)})
            found[name] = pa.chunked_array([_array(part, kind) for part in parts], kind)
        return found


def _kinds(values: pa.Array | list[Any]) -> set[pa.DataType]:
    """Return the types of values."""
    if isinstance(values, pa.Array):
        return {values.type}
    return {_TYPES.get(kind, pa.string()) for kind in set(map(type, values))}


_TYPES = {type(None): pa.null(), bool: pa.bool_(), int: pa.int64(), float: pa.float64()}


def _common(kinds: set[pa.DataType]) -> pa.DataType:
    """Return the type of a column with values of these types: a text if they are different."""
    kinds = kinds - {pa.null()}
    if len(kinds) == 1:
        return kinds.pop()
    return pa.float64() if kinds <= {pa.int64(), pa.float64()} else pa.string()


def _array(values: pa.Array | list[Any], kind: pa.DataType) -> pa.Array:
    """Return values as a type; texts are those of Python."""
    if isinstance(values, pa.Array):
        if values.type == kind or kind != pa.string():
            return values.cast(kind)
        values = values.to_pylist()
    if kind == pa.string():
        values = [each if each is None else str(each) for each in values]
    return pa.array(values, kind, from_pandas=False)


def _factor_columns(texts: Sequence[str]) -> dict[str, pa.Array | list[Any]]:
    """Return the columns of stored factors; equal texts are read once.

    Raises:
        ValueError: A text is invalid.
    """
    places = {text: k for k, text in enumerate(dict.fromkeys(texts))}
    rows = _loaded(places)
    columns: dict[str, pa.Array | list[Any]] = {}
    index = [places[text] for text in texts]
    for name in dict.fromkeys(name for row in rows for name in row):
        values = [row.get(name) for row in rows]
        kinds = _kinds(values)
        columns[name] = (
            _array(values, _common(kinds)).take(pa.array(index, pa.int64()))
            if len(kinds) == 1 and pa.null() not in kinds
            else [values[k] for k in index]
        )
    return columns


def _loaded(texts: Collection[str]) -> list[dict[str, Any]]:
    """Return the values of stored texts."""
    values = json.loads(f"[{','.join(texts)}]")
    if len(values) != len(texts) or not all(isinstance(each, dict) for each in values):
        raise ValueError("factors of a run are no mapping")
    return list(values)


def _float_columns(
    texts: Sequence[str], floats: Sequence[bytes]
) -> tuple[dict[str, pa.Array], dict[str, pa.Array]]:
    """Return the columns of stored metrics and of computing times.

    Raises:
        ValueError: Names or numbers are invalid.
    """
    places: dict[str, list[int]] = {}
    for k, text in enumerate(texts):
        places.setdefault(text, []).append(k)
    found: tuple[dict[str, pa.Array], dict[str, pa.Array]] = {}, {}
    values: tuple[dict[str, Any], dict[str, Any]] = {}, {}
    known: tuple[dict[str, Any], dict[str, Any]] = {}, {}
    for text, rows in places.items():
        names = names_of(text)
        count = len(names[0]) + len(names[1])
        content = b"".join([floats[k] for k in rows])
        if any(len(floats[k]) != 8 * count for k in rows):
            raise ValueError("the number of metrics is wrong")
        matrix, index = np.frombuffer(content, "<f8").reshape(len(rows), count), np.array(rows)
        for kind, first in ((0, 0), (1, len(names[0]))):
            for column, name in enumerate(names[kind], first):
                array = values[kind].setdefault(name, np.zeros(len(texts)))
                mask = known[kind].setdefault(name, np.zeros(len(texts), dtype=bool))
                array[index], mask[index] = matrix[:, column], True
    for kind in (0, 1):
        for name, array in values[kind].items():
            found[kind][name] = pa.array(array, pa.float64(), mask=~known[kind][name])
    return found
