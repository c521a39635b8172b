"""Logs of commands, wheel speeds and poses, in CSV or Parquet."""

from __future__ import annotations

import re
from dataclasses import dataclass
from io import BytesIO

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, one_line, suggestion
from omnidrive.files.bounded_file import read_bounded
from omnidrive.files.number_table import table_format
from omnidrive.files.str_path import StrPath, to_path

_COMMAND = ("command_vx", "command_vy", "command_yaw_rate")
_POSE = ("x", "y", "yaw")
_WHEEL = re.compile(r"wheel_speed_(\d{1,2})")
_MAX_BYTES = 200_000_000
_MAX_ROWS = 1_000_000
_MAX_COLUMNS = 1000
_MAX_HEAD = 100_000  # bytes, in which the titles and the first row are
_MAX_VALUE = 1e10
_MAX_DURATION = 3600.0  # s


@dataclass(frozen=True, eq=False, slots=True)
class RobotLog:
    """Samples of a drive.

    Attributes:
        t: Time of each sample, s; increasing.
        commands: Body twist commanded from each sample to the next, in B; m/s, m/s, rad/s.
        poses: Measured pose of B in W at each sample; m, m, rad; NaN: not measured. The yaw may be
            wrapped.
        wheel_speeds: Speed of each wheel at each sample, rad/s, with the signs of the wheel matrix;
            a row of NaN, or None: not measured.
        mean_wheel_speeds: Whether each row of wheel speeds is the mean since the row of them
            before, such as from wheel angles; else it is that of the instant.

    Raises:
        InvalidInput: Times do not increase, a number is not finite, or fewer than two poses are
            measured.
    """

    t: Float[Array, " rows"]
    commands: Float[Array, "rows 3"]
    poses: Float[Array, "rows 3"]
    wheel_speeds: Float[Array, "rows wheels"] | None = None
    mean_wheel_speeds: bool = False

    def __post_init__(self) -> None:
        if len(self.t) < 2:
            raise InvalidInput(f"the log has {len(self.t)} samples, need at least 2")
        last = np.where(np.isnan(self.commands[-1:]), 0.0, self.commands[-1:])  # it has no effect
        commands = np.vstack([self.commands[:-1], last])
        blocks = {"t": self.t, "commands": commands, "poses": _known(self.poses)}
        if self.wheel_speeds is not None:
            blocks["wheel speeds"] = _known(self.wheel_speeds)
            measured = (~np.isnan(self.wheel_speeds)).all(axis=1).sum()
            if measured < 2:
                raise InvalidInput(f"the log has {measured} rows of wheel speeds, need at least 2")
        for name, block in blocks.items():
            wrong = ~(np.abs(block) <= _MAX_VALUE)  # NaN as well
            if wrong.any():
                row = int(np.argwhere(wrong)[0][0])
                raise InvalidInput(
                    f"the log's {name} in sample {row} are not finite numbers of at most "
                    f"{_MAX_VALUE:g}"
                )
        if self.measured.sum() < 2:
            raise InvalidInput(f"the log has {self.measured.sum()} measured poses, need at least 2")
        if self.t[-1] - self.t[0] > _MAX_DURATION:
            raise InvalidInput(
                f"the log lasts {self.t[-1] - self.t[0]:g} s, need at most {_MAX_DURATION:g} s: "
                "select a part"
            )
        back = np.flatnonzero(np.diff(self.t) <= 0.0)
        if len(back):
            k = int(back[0])
            raise InvalidInput(
                f"the log's times must increase, but sample {k + 1} is at {self.t[k + 1]:g} s "
                f"after {self.t[k]:g} s"
            )

    @property
    def measured(self) -> Bool[Array, " rows"]:
        """At which samples the pose is measured."""
        found: Bool[Array, " rows"] = ~np.isnan(self.poses).all(axis=1)
        return found


def _known(block: Float[Array, "rows columns"]) -> Float[Array, "rows columns"]:
    """Return a block with zeros in rows in which nothing is measured."""
    return np.where(np.isnan(block).all(axis=1, keepdims=True), 0.0, block)


def read_log(path: StrPath) -> RobotLog:
    """Read a log from a CSV or Parquet file.

    The columns are ``t`` in s; ``command_vx``, ``command_vy``, ``command_yaw_rate`` in m/s, m/s,
    rad/s; ``x``, ``y``, ``yaw`` in m, m, rad, all three empty in samples without a measured pose;
    and optionally ``wheel_speed_0``, ``wheel_speed_1``, ... in rad/s. The order of the columns does
    not matter, and others are ignored. The time series of run folders have these columns.

    Raises:
        InvalidInput: The file cannot be read, is too large, or lacks a column; or see
            :class:`RobotLog`.
    """
    path = to_path(path)
    name = one_line(str(path))
    suffix = path.suffix.lower()
    if suffix not in {".csv", ".parquet"}:
        raise InvalidInput(
            f"{name}: the suffix of a log is .csv or .parquet, or .mcap for the log of a drive"
        )
    content = read_bounded(
        path, _MAX_BYTES, "log", InvalidInput,
        excess=f"is too large for a log: more than {_MAX_BYTES:,} bytes",
    )  # fmt: skip
    try:
        columns = _csv(content) if suffix == ".csv" else _parquet(content)
        return _log(columns)
    except (pa.ArrowException, UnicodeDecodeError, OSError, KeyError) as error:
        reason = one_line(" ".join(str(error).split()), 200)
        raise InvalidInput(f"{name} is not a log: {reason}") from None
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from None


def _csv(content: bytes) -> dict[str, Array]:
    head = content[:_MAX_HEAD].decode("utf-8-sig", errors="replace").splitlines()
    try:
        form = table_format(head)
    except ValueError as error:
        raise InvalidInput(f"the titles are not readable: {error}") from None
    used = _used_columns([*form.titles])
    for name in used:
        if form.titles.count(name) > 1:
            raise InvalidInput(f"there are two columns '{name}'; remove one")
    if content.count(b"\n") > _MAX_ROWS + form.first_row:
        raise InvalidInput(f"there are more than {_MAX_ROWS:,} samples")
    if form.separator == " ":
        content = re.sub(rb"[ \t]+", b" ", content)  # first, so that the next one is linear
        content = re.sub(rb" (?=\r?$)|^ ", b"", content, flags=re.MULTILINE)
    table = pa.csv.read_csv(
        BytesIO(content),
        read_options=pa.csv.ReadOptions(skip_rows=form.first_row - 1, column_names=form.titles),
        parse_options=pa.csv.ParseOptions(delimiter=form.separator),
        convert_options=pa.csv.ConvertOptions(
            decimal_point=form.decimal,
            include_columns=used,
            column_types=dict.fromkeys(used, pa.float64()),
        ),
    )
    return _arrays(table)


def _parquet(content: bytes) -> dict[str, Array]:
    file = pa.parquet.ParquetFile(BytesIO(content))
    if file.metadata.num_rows > _MAX_ROWS:
        raise InvalidInput(f"there are more than {_MAX_ROWS:,} samples")
    used = _used_columns(file.schema_arrow.names)
    for name in used:
        kind = file.schema_arrow.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            raise InvalidInput(f"the column {name} holds {kind}, not numbers")
    return _arrays(file.read(columns=used))


def _used_columns(titles: list[str]) -> list[str]:
    """Return the names of the columns to read; raise unless all required ones are there."""
    if len(titles) > _MAX_COLUMNS:
        raise InvalidInput(f"there are more than {_MAX_COLUMNS} columns")
    missing = [name for name in ("t", *_COMMAND, *_POSE) if name not in titles]
    if len(missing) == 1:
        raise InvalidInput(f"there is no column '{missing[0]}'{suggestion(missing[0], titles)}")
    if missing:
        names = ", ".join(f"'{name}'" for name in missing)
        there = ", ".join(one_line(title, 60) for title in titles[:12])
        raise InvalidInput(
            f"there are no columns {names}; rename those of the file with these contents: {there}"
        )
    wheels = sorted(int(match[1]) for title in titles if (match := _WHEEL.fullmatch(title)))
    if wheels != list(range(len(wheels))):
        raise InvalidInput(
            f"the columns wheel_speed_N must be numbered from 0, got {', '.join(map(str, wheels))}"
        )
    return ["t", *_COMMAND, *_POSE, *(f"wheel_speed_{i}" for i in wheels)]


def _arrays(table: pa.Table) -> dict[str, Array]:
    return {
        name: table.column(name).to_numpy().astype(np.float64, copy=False)
        for name in table.column_names
    }


def _log(columns: dict[str, Array]) -> RobotLog:
    wheels = [name for name in columns if _WHEEL.fullmatch(name)]
    speeds = np.column_stack([columns[name] for name in wheels]) if wheels else None
    if speeds is not None and np.isnan(speeds).all():  # a plant that does not report them
        speeds = None
    commands = np.column_stack([columns[name] for name in _COMMAND])
    return RobotLog(columns["t"], commands, np.column_stack([columns[n] for n in _POSE]), speeds)
