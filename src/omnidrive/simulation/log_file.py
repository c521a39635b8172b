"""The log of a run as a table and as a file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from omnidrive.errors import InvalidInput, MissingExtra, one_line
from omnidrive.files.output_file import output_file
from omnidrive.simulation.log_columns import LogColumn
from omnidrive.simulation.mcap_log import mcap_writer, write_mcap

if TYPE_CHECKING:
    from pandas import DataFrame

_SUFFIXES = (".parquet", ".csv", ".mcap")
ENDING = b"omnidrive.ending"
"""Key of the metadata of a Parquet file with what its columns do not contain, as JSON."""


def log_table(columns: Sequence[LogColumn]) -> pa.Table:
    """Return the columns as a table; the metadata of each column contain its ``unit``."""
    schema = pa.schema(
        [
            pa.field(name, pa.from_numpy_dtype(values.dtype), metadata={"unit": unit})
            for name, unit, values in columns
        ]
    )
    return pa.table([pa.array(column.values) for column in columns], schema=schema)


def log_frame(columns: Sequence[LogColumn]) -> DataFrame:
    """Return the columns as a pandas table; ``attrs["units"]`` are their units, by name.

    Raises:
        MissingExtra: pandas is not installed.
    """
    try:
        pandas = import_module("pandas")
    except ModuleNotFoundError:
        raise MissingExtra(
            "to_pandas needs pandas, which is not installed: pip install pandas"
        ) from None
    frame: DataFrame = pandas.DataFrame({column.name: column.values for column in columns})
    frame.attrs["units"] = {column.name: column.unit for column in columns}
    return frame


def save_log(columns: Sequence[LogColumn], ending: Mapping[str, Any], path: Path) -> None:
    """Write a log to a Parquet, CSV or MCAP file.

    Args:
        columns: Columns of the log, ``t`` among them.
        ending: What the columns do not contain, as values of JSON: ``outcome`` with ``reason``, and
            ``events``, which MCAP files contain as messages; Parquet files contain all of it.
        path: File name; an existing file is overwritten.

    Raises:
        InvalidInput: The suffix of the file name is another one.
        MissingExtra: The suffix is .mcap, and the package mcap is not installed.
        CannotWrite: The file cannot be written.
    """
    check_log_file(path)
    suffix = path.suffix.lower()
    writer = mcap_writer() if suffix == ".mcap" else None
    with output_file(path) as part, part.open("wb") as file:  # pyarrow refuses some file names
        if writer:
            write_mcap(writer(file), columns, ending["events"])
        elif suffix == ".csv":
            pa.csv.write_csv(log_table(columns), file)
        else:
            table = log_table(columns).replace_schema_metadata({ENDING: json.dumps(dict(ending))})
            pa.parquet.write_table(table, file, write_page_checksum=True)


def check_log_file(path: Path) -> None:
    """Raise :class:`InvalidInput` unless the suffix of a file name is that of a log."""
    if path.suffix.lower() not in _SUFFIXES:
        raise InvalidInput(
            f"{one_line(str(path))}: the suffix of a log is one of {', '.join(_SUFFIXES)}"
        )
