"""Reading of a run from the Parquet file of its log."""

from __future__ import annotations

import json
from collections.abc import Iterable
from io import BytesIO
from math import isfinite
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.control.supervision import Event
from omnidrive.errors import InvalidLog, one_line
from omnidrive.files.bounded_file import read_bounded
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.simulation.log_columns import POSE, TWIST
from omnidrive.simulation.log_file import ENDING
from omnidrive.simulation.run import Outcome, Run

_MAX_BYTES, _MAX_COLUMNS, _MAX_VALUES = 500_000_000, 2000, 100_000_000
_REAL, _WHOLE = ("t", "work", "step_time"), ("status", "collisions", "saturated")
_POSES = {"pose": "", "measured": "measured_", "target": "target_"}
_TWISTS = {"command": "command_", "twist": "actual_"}
_SIGMAS = ("position_sigma", "yaw_sigma")
_WHEELS = {
    "wheel_speed": "wheel_speed",
    "wheel_torque": "wheel_torque",
    "wheel_speed_command": "command_wheel_speed",
    "wheel_torque_command": "command_wheel_torque",
}


def load_run(path: StrPath) -> Run:
    """Return the run that was written to a Parquet file, such as ``series/NAME.parquet``.

    Raises:
        InvalidLog: The file cannot be read, is too large, is damaged or is no log of a run.
    """
    path = to_path(path)
    name = one_line(str(path))
    content = read_bounded(
        path, _MAX_BYTES, "log", InvalidLog,
        excess=f"is too large for the log of a run: more than {_MAX_BYTES:,} bytes",
    )  # fmt: skip
    try:
        file = pa.parquet.ParquetFile(BytesIO(content), page_checksum_verification=True)
        _check_size(file)
        return _run(file.read())
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError, RecursionError) as error:
        fact = f"there is no {error}" if isinstance(error, KeyError) else str(error)
        reason = one_line(" ".join(fact.split()), 200)
        raise InvalidLog(f"{name} is not the log of a run: {reason}") from None


def _check_size(file: pa.parquet.ParquetFile) -> None:
    """Raise ValueError if a file has too many values, or two columns of one name."""
    names, rows = file.schema_arrow.names, file.metadata.num_rows
    if len(names) > _MAX_COLUMNS or len(names) * rows > _MAX_VALUES:
        raise ValueError(f"it has {len(names):,} columns and {rows:,} samples, too many")
    if len(set(names)) < len(names):
        raise ValueError("two columns have one name")


def _run(table: pa.Table) -> Run:
    """Return the run of a table with the metadata of :meth:`Run.save`.

    Raises:
        KeyError: A column or an entry of the metadata is missing.
        ValueError: A value is invalid.
        TypeError: A value has another type.
        pa.ArrowException: A column has no numbers.
    """
    columns = {name: table[name] for name in table.column_names}
    units = {each.name: (each.metadata or {}).get(b"unit", b"1").decode() for each in table.schema}

    def take(names: Iterable[str]) -> Float[Array, "rows _"]:
        """Take columns out of the table, side by side."""
        taken = [_numbers(columns.pop(name)) for name in names]
        return np.column_stack(taken) if taken else np.empty((table.num_rows, 0))

    def wheels(name: str) -> Float[Array, "rows _"]:
        """Take the columns of a quantity of each wheel."""
        count = next(i for i in range(len(columns) + 1) if f"{name}_{i}" not in columns)
        return take(f"{name}_{i}" for i in range(count))

    real = {name: take([name])[:, 0] for name in _REAL}
    if not (len(real["t"]) and np.isfinite(real["t"]).all() and (np.diff(real["t"]) > 0.0).all()):
        raise ValueError("its times are not finite and increasing")
    unknown = np.full(table.num_rows, np.nan)
    fields: dict[str, Any] = {
        **real,
        **{name: _whole_numbers(columns.pop(name)) for name in _WHOLE},
        **{name: take(prefix + key for key, _ in POSE) for name, prefix in _POSES.items()},
        **{name: take(prefix + key for key, _ in TWIST) for name, prefix in _TWISTS.items()},
        **{name: wheels(prefix) for name, prefix in _WHEELS.items()},
        **{name: take([name])[:, 0] if name in columns else unknown for name in _SIGMAS},
        **_checked_ending(table.schema.metadata or {}),
    }
    details = {name: _numbers(column) for name, column in columns.items()}
    return Run(**fields, details=details, detail_units={name: units[name] for name in details})


def _whole_numbers(column: pa.ChunkedArray) -> Int[Array, " rows"]:
    if column.null_count:
        raise ValueError("a column of whole numbers lacks values")
    values: Int[Array, " rows"] = column.cast(pa.int64()).to_numpy()
    return values


def _numbers(column: pa.ChunkedArray) -> Float[Array, " rows"]:
    values: Float[Array, " rows"] = column.cast(pa.float64()).to_numpy()
    return values


def _checked_ending(metadata: dict[bytes, bytes]) -> dict[str, Any]:
    """Return outcome, reason, traceback and events of a file."""
    if ENDING not in metadata:
        raise ValueError("its outcome and its events are missing")
    ending = json.loads(metadata[ENDING])
    texts = {name: ending[name] for name in ("reason", "traceback")}
    events = tuple(Event(float(t), what) for t, what in ending["events"])
    if not all(isinstance(each, str) for each in (*texts.values(), *(e.what for e in events))):
        raise TypeError("a text of its metadata is none")
    if not all(isfinite(event.t) for event in events):
        raise ValueError("the time of an event is not finite")
    return {"outcome": Outcome[ending["outcome"]], **texts, "events": events}
