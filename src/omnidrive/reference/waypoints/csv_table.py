"""Waypoints as a table of comma-separated values.

The first line contains the column names, in any order: ``x``, ``y``, ``yaw``, in a timed file also
``t``, and optionally the velocities in W ``vx``, ``vy``, ``yaw_rate``. A name may include its unit,
as ``yaw_deg``, ``yaw [deg]`` or ``vx_m_per_s``, or a line ``# units: s, m, m, deg`` gives all
units; the default units are s, m and rad. Other lines that begin with ``#`` are comments.
"""

from __future__ import annotations

import pathlib
import re
from math import pi

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference, one_line, short_repr, suggestion
from omnidrive.files.number_text import parse_number
from omnidrive.planning import Path
from omnidrive.reference.sampled_reference import MAX_SAMPLES, MAX_VALUE
from omnidrive.reference.waypoints.text_file import read_text, write_text
from omnidrive.reference.waypoints.waypoints import Waypoints, timed_waypoints, untimed_waypoints

_POSE, _TWIST = ("x", "y", "yaw"), ("vx", "vy", "yaw_rate")
_DEGREE = pi / 180.0
_TIME = {"s": 1.0, "ms": 1e-3}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_ANGLE = {"rad": 1.0, "deg": _DEGREE}
_SPEED = {"m_per_s": 1.0, "m_s": 1.0}
_YAW_RATE = {"rad_per_s": 1.0, "rad_s": 1.0, "deg_per_s": _DEGREE, "deg_s": _DEGREE}
_UNITS = {
    "t": _TIME, "x": _LENGTH, "y": _LENGTH, "yaw": _ANGLE,
    "vx": _SPEED, "vy": _SPEED, "yaw_rate": _YAW_RATE,
}  # fmt: skip
_ALIASES = {"time": "t", "theta": "yaw", "heading": "yaw", "omega": "yaw_rate"}
_MAX_TITLE = 60
_MAX_LINES = 2 * MAX_SAMPLES  # including comments and empty lines
_PATH_HEADER = "x_m,y_m,yaw_rad"
_INTERPOLATION = (
    "# Between rows x, y and yaw are cubic polynomials of the poses and velocities (Hermite)."
)
_TIMED_HEADER = f"t_s,{_PATH_HEADER},vx_m_per_s,vy_m_per_s,yaw_rate_rad_per_s"


def read_csv(file: pathlib.Path) -> Waypoints:
    """Read a table as a :class:`SampledReference` if it has times, else as a :class:`Path`.

    Raises:
        InvalidReference: The file is not a valid table; the message gives the position.
    """
    name, text = one_line(str(file)), read_text(file)
    columns: dict[str, float] = {}
    units: list[str] = []
    rows, lines = [], []
    for number, line in enumerate(_lines(name, text), 1):
        where = f"{name}, line {number}"
        cells = [cell.strip().strip('"') for cell in line.split(",")]
        if line.lstrip().startswith("#"):
            cells[0] = cells[0].lstrip("#").strip()
            if cells[0].lower().startswith("units:"):
                units = [cells[0][len("units:") :].strip(), *cells[1:]]
            elif not columns and len(cells) <= len(_UNITS) and all(map(_column, cells)):
                columns = _columns(where, cells)
        elif any(cells) and not columns:
            columns = _columns(where, cells)
        elif any(cells):
            rows.append(_numbers(where, cells, len(columns)))
            lines.append(number)
    if not columns:
        raise InvalidReference(f"{name} is empty; a table of waypoints starts with {_PATH_HEADER}")
    table = np.array(rows, dtype=float).reshape(-1, len(columns))
    _check_values(name, lines, table)
    table *= _factors(name, columns, units)
    return _waypoints(name, lines, dict(zip(columns, table.T, strict=True)))


def write_csv(file: pathlib.Path, waypoints: Waypoints, _frame_id: str) -> None:
    """Write a table, which :func:`read_csv` restores exactly; it does not contain the frame.

    A comment in the first line of a timed table states the interpolation between rows.
    """
    if isinstance(waypoints, Path):
        header, table = _PATH_HEADER, waypoints.poses
    else:
        header = f"{_INTERPOLATION}\n{_TIMED_HEADER}"
        table = np.column_stack([waypoints.times, waypoints.poses, waypoints.twists])
    rows = (",".join(map(repr, row)) for row in table.tolist())
    write_text(file, "\n".join([header, *rows, ""]))


def _lines(name: str, text: str) -> list[str]:
    """Return the lines of a table, or raise InvalidReference if there are too many."""
    lines = text.splitlines()
    if len(lines) > _MAX_LINES:
        raise InvalidReference(f"{name} has more than {_MAX_LINES:,} lines; thin them out")
    return lines


def _waypoints(name: str, lines: list[int], column: dict[str, Float[Array, " rows"]]) -> Waypoints:
    poses = np.column_stack([column[key] for key in _POSE])
    if "t" not in column:
        return untimed_waypoints(name, poses)
    twists = np.column_stack([column[key] for key in _TWIST]) if "vx" in column else None
    return timed_waypoints(name, lambda i: f"line {lines[i]}", column["t"], poses, twists)


def _column(title: str) -> tuple[str, str] | None:
    """Return the quantity and unit of a column title ("" for no unit), or None if unknown."""
    if len(title) > _MAX_TITLE:
        return None
    words = re.sub(r"[^a-z0-9]+", "_", title.lower().replace("/", " per ")).strip("_")
    for quantity in sorted((*_UNITS, *_ALIASES), key=len, reverse=True):
        known = _ALIASES.get(quantity, quantity)
        if words == quantity:
            return known, ""
        unit = words.removeprefix(f"{quantity}_")
        if unit != words and unit in _UNITS[known]:
            return known, unit
    return None


def _columns(where: str, titles: list[str]) -> dict[str, float]:
    """Return the unit factor of each column by its quantity, 0 where the title has no unit."""
    columns: dict[str, float] = {}
    for title in titles:
        found = _column(title)
        if found is None:
            hint = suggestion(title, [*_UNITS, *_ALIASES])
            raise InvalidReference(f"{where}: unknown column {short_repr(title)}{hint}")
        quantity, unit = found
        if quantity in columns:
            raise InvalidReference(f"{where}: two columns contain {quantity}; remove one")
        columns[quantity] = _UNITS[quantity].get(unit, 0.0)
    missing = [key for key in _POSE if key not in columns]
    velocities = [key for key in _TWIST if key in columns]
    if velocities and len(velocities) < len(_TWIST):
        missing += [key for key in _TWIST if key not in columns]
    if velocities and "t" not in columns:
        missing.append("t")
    if missing:
        raise InvalidReference(f"{where}: there is no column {' and no column '.join(missing)}")
    return columns


def _factors(name: str, columns: dict[str, float], units: list[str]) -> Float[Array, " columns"]:
    """Return the factor of each column for SI units."""
    if units and len(units) != len(columns):
        raise InvalidReference(f"{name}: {len(units)} units for {len(columns)} columns")
    factors = []
    for i, (quantity, factor) in enumerate(columns.items()):
        column = _column(f"{quantity} {units[i]}") if units else None
        if units and column is None:
            known = ", ".join(_UNITS[quantity])
            raise InvalidReference(
                f"{name}: unknown unit {short_repr(units[i])} of {quantity}; there are {known}"
            )
        factors.append(factor or _UNITS[quantity].get(column[1] if column else "", 1.0))
    return np.array(factors)


def _numbers(where: str, cells: list[str], count: int) -> list[float]:
    if len(cells) != count:
        raise InvalidReference(
            f"{where}: {len(cells)} values, but the first line has {count} columns"
        )
    numbers: list[float] = []
    for cell in cells:
        number = parse_number(cell)
        if number is None:
            raise InvalidReference(f"{where}: {short_repr(cell)} is not a number")
        numbers.append(number)
    return numbers


def _check_values(name: str, lines: list[int], table: Float[Array, "rows columns"]) -> None:
    beyond = np.argwhere(~(np.abs(table) <= MAX_VALUE))  # NaN as well
    if len(beyond):
        i, j = beyond[0]
        raise InvalidReference(
            f"{name}, line {lines[i]}: {table[i, j]:g} is not a finite number of at most "
            f"{MAX_VALUE:g} in magnitude"
        )
