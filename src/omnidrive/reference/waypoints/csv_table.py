"""Waypoints as a table of numbers.

Titles name the columns, in any order, in the first line or in a comment before the first row:
``x``, ``y``, ``yaw``, in a timed file also ``t``, and optionally the velocities in W ``vx``,
``vy``, ``yaw_rate``; for the format see :mod:`omnidrive.files.number_table`. A title may include
the unit, as ``yaw_deg``, ``yaw [deg]`` or ``vx_m_per_s``, or a line ``# units: s, m, m, deg`` gives
all units; the default units are s, m and rad. A quaternion ``qx``, ``qy``, ``qz``, ``qw`` may stand
for the yaw. Without both, the heading is the direction of travel. Other columns are ignored, and
other lines that begin with ``#`` are comments.

In race lines with the columns ``psi_rad`` and ``kappa_radpm``, psi counts from the y axis, as in
those of TUM (TUMFTM/global_racetrajectory_optimization, Readme: "Zero is north (along y-axis)"; its
trajectory_planning_helpers compute psi = atan2(dy, dx) - pi/2), unless it is the direction of
travel from the x axis, as in files of other programs with these titles.
"""

from __future__ import annotations

import logging
import pathlib
from math import pi

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.choices import TableHeading
from omnidrive.errors import InvalidReference, one_line, short_repr
from omnidrive.files.number_table import (
    COMMENT,
    TableFormat,
    split_cells,
    table_format,
    table_separator,
)
from omnidrive.geometry import wrap
from omnidrive.planning import Path
from omnidrive.planning.headings import with_headings
from omnidrive.reference.sampled_reference import MAX_SAMPLES, MAX_VALUE
from omnidrive.reference.waypoints.table_columns import (
    POSITION,
    QUATERNION,
    TWIST,
    UNITS,
    UNNAMED,
    Columns,
    quantity_of,
    table_columns,
)
from omnidrive.reference.waypoints.text_file import read_text, write_text
from omnidrive.reference.waypoints.waypoints import Waypoints, timed_waypoints, untimed_waypoints

_NUMBERED_ROWS = 20  # of which numbers of rows are detected
_MAX_SHOWN = 12  # columns that are named
_MAX_LINES = 2 * MAX_SAMPLES  # including comments and empty lines
_PATH_HEADER = "x_m,y_m,yaw_rad"
_INTERPOLATION = (
    "# Between rows x, y and yaw are cubic polynomials of the poses and velocities (Hermite)."
)
_TIMED_HEADER = f"t_s,{_PATH_HEADER},vx_m_per_s,vy_m_per_s,yaw_rate_rad_per_s"
_NORM_TOLERANCE = 0.01  # of the norm of a quaternion from 1
_CLOCKS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
"""Least times of clocks that count from 1970, by unit; in s it would be the year 5138."""

_log = logging.getLogger("omnidrive")


def read_csv(file: pathlib.Path, heading: TableHeading = "tangent") -> Waypoints:
    """Read a table as a :class:`SampledReference` if it has times, else as a :class:`Path`.

    Columns that are ignored, and quantities or units that no title gives, are logged.

    Args:
        file: The file.
        heading: Heading of a table without one: the direction of travel, or along the x axis.

    Raises:
        InvalidReference: The file is not a valid table; the message gives the position.
    """
    name, text = one_line(str(file)), read_text(file)
    lines = text.splitlines()
    if len(lines) > _MAX_LINES:
        raise InvalidReference(f"{name} has more than {_MAX_LINES:,} lines; thin them out")
    try:
        form = table_format(lines)
    except ValueError as error:
        raise InvalidReference(f"{name}: {error}") from None
    if form.first_row > len(lines) and not form.titles:
        raise InvalidReference(f"{name} is empty; a table of waypoints starts with {_PATH_HEADER}")
    columns, count = _columns(name, form, lines)
    if columns.unused:
        shown = ", ".join(columns.unused[:_MAX_SHOWN])
        more = ", ..." if len(columns.unused) > _MAX_SHOWN else ""
        _log.warning("%s: columns that are not used: %s%s", name, shown, more)
    numbers, table = _rows(name, form, lines, (columns, count))
    units = _units(name, lines, count)
    factors = _factors(name, columns, units, table)
    table *= factors
    _check_values(name, numbers, table)
    column = dict(zip(columns.place, table.T, strict=True))
    if columns.is_race_line:
        column["yaw"] = _yaw_of_race_line(name, column)
    return _waypoints(name, numbers, column, heading)


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


def _columns(name: str, form: TableFormat, lines: list[str]) -> tuple[Columns, int]:
    """Return the columns that are read, and the number of all columns."""
    if form.titles:
        return table_columns(f"{name}, line {form.title_line}", form.titles), len(form.titles)
    count = len(form.cells(lines[form.first_row - 1]))
    titles = UNNAMED.get(count)
    if titles is None:
        raise InvalidReference(
            f"{name}, line {form.first_row}: {count} columns without titles; start the table with "
            f"a line of titles such as {_PATH_HEADER}"
        )
    _log.warning(
        "%s: the columns have no titles and are read as %s%s",
        name, ", ".join(titles), _possible_numbering(name, form, lines, titles),
    )  # fmt: skip
    return table_columns(name, titles)._replace(unused=()), count


def _possible_numbering(
    name: str, form: TableFormat, lines: list[str], titles: tuple[str, ...]
) -> str:
    """Return a remark if a table without titles may have the column or row numbers of pandas.

    They count from 0. In the first line they may also be a waypoint, and in the first column times,
    or positions if there is only one other column.

    Raises:
        InvalidReference: There certainly are such numbers: those of columns after an empty cell,
            those of rows before two columns of decimal fractions.
    """
    text = [line for line in lines[form.first_row - 1 :] if line.strip()]
    try:
        rows = [form.cells(line) for line in text[:_NUMBERED_ROWS]]
    except ValueError:
        return ""  # the error of the row states it
    remedy = "give the columns titles, as in df.to_csv(file, index=False) with the columns x, y"
    first = [cell for cell in rows[0] if cell]
    if first == list(map(str, range(len(first)))):
        if not rows[0][0]:
            raise InvalidReference(
                f"{name}, line {form.first_row}: {', '.join(first)} are the numbers of columns, "
                f"not a waypoint; {remedy}"
            )
        if rows[1:] and all(form.decimal in cell for cell in rows[1]):
            return "; the first line may be the numbers of columns"
    counted = [row[0] for row in rows] == list(map(str, range(len(rows))))
    if counted and len(rows) > 2 and all(form.decimal in cell for row in rows for cell in row[1:]):
        if len(titles) == 2 or titles[0] == "t":
            return "; the first column may be the numbers of rows"
        raise InvalidReference(
            f"{name}: the first column, 0, 1, 2, ..., has the numbers of rows; {remedy}"
        )
    return ""


def _rows(
    name: str, form: TableFormat, lines: list[str], columns: tuple[Columns, int]
) -> tuple[list[int], Float[Array, "rows columns"]]:
    """Return the line of each row, and the used columns in the order of their quantities."""
    used, count = [*columns[0].place.values()], columns[1]
    numbers, rows = [], []
    for number, line in enumerate(lines[form.first_row - 1 :], form.first_row):
        if line.lstrip().startswith(COMMENT):
            continue
        where = f"{name}, line {number}"
        try:
            cells = form.cells(line)
        except ValueError as error:
            raise InvalidReference(f"{where}: {error}") from None
        if not any(cells):
            continue
        if len(cells) != count:
            raise InvalidReference(
                f"{where}: {len(cells)} values, but the table has {count} columns"
            )
        row = [form.number(cells[i]) for i in used]
        if None in row:
            wrong = cells[used[row.index(None)]]
            raise InvalidReference(f"{where}: {short_repr(wrong)} is not a number")
        rows.append(row)
        numbers.append(number)
    return numbers, np.array(rows, dtype=float).reshape(-1, len(used))


def _units(name: str, lines: list[str], count: int) -> list[str]:
    """Return the units of all columns from the last line ``# units:``; empty without one."""
    units: list[str] = []
    for line in lines:
        words = line.lstrip()
        text = words.lstrip(COMMENT).strip() if words.startswith(COMMENT) else ""
        if text.lower().startswith("units:"):
            text = text[len("units:") :]
            units = split_cells(text.replace('"', ""), table_separator(text))
    if units and len(units) != count:
        raise InvalidReference(f"{name}: {len(units)} units for {count} columns")
    return units


def _factors(
    name: str, columns: Columns, units: list[str], table: Float[Array, "rows columns"]
) -> Float[Array, " columns"]:
    """Return the factor of each column for SI units."""
    factors = []
    for j, (quantity, i) in enumerate(columns.place.items()):
        found = quantity_of(f"{quantity} {units[i]}") if units else None
        if units and found is None:
            known = ", ".join(UNITS[quantity])
            raise InvalidReference(
                f"{name}: unknown unit {short_repr(units[i])} of {quantity}; there are {known}"
            )
        factor = columns.factor[quantity] or UNITS[quantity].get(found[1] if found else "", 0.0)
        if quantity == "t" and not factor:
            factor = _clock(name, table[:1, j])
        factors.append(factor or 1.0)
    return np.array(factors)


def _clock(name: str, first: Float[Array, " n"]) -> float:
    """Return the factor of times without a unit from the first: s, or that of an epoch's clock."""
    for minimum, unit in _CLOCKS:
        if (first >= minimum).any():
            _log.warning("%s: the times, from %g on, are read in %s", name, first[0], unit)
            return UNITS["t"][unit]
    return 1.0


def _waypoints(
    name: str, lines: list[int], column: dict[str, Float[Array, " rows"]], heading: TableHeading
) -> Waypoints:
    position = np.column_stack([column[key] for key in POSITION])
    twists = np.column_stack([column[key] for key in TWIST]) if "vx" in column else None
    if "yaw" in column:
        poses = np.column_stack([position, column["yaw"]])
    elif QUATERNION[0] in column:
        q = np.column_stack([column[key] for key in QUATERNION])
        poses = np.column_stack([position, _yaw(name, lines, q)])
    else:
        twists = None  # the yaw rate is that of another heading
        poses = _with_heading(name, position, heading)
    if "t" not in column:
        return untimed_waypoints(name, poses)
    return timed_waypoints(name, lambda i: f"line {lines[i]}", column["t"], poses, twists)


def _with_heading(
    name: str, position: Float[Array, "rows 2"], heading: TableHeading
) -> Float[Array, "rows 3"]:
    """Return poses at the positions with the heading of a table that has none."""
    tangent = heading == "tangent" and len(position) > 1
    which = "the direction of travel" if heading == "tangent" else "0 rad"
    _log.warning("%s: no column yaw; the heading is %s (--heading tangent or fixed)", name, which)
    if tangent:
        return with_headings(position, None, None, 0.0)
    return np.column_stack([position, np.zeros(len(position))])


def _yaw(name: str, lines: list[int], q: Float[Array, "rows 4"]) -> Float[Array, " rows"]:
    """Return the yaw of quaternions (x, y, z, w), rad: Diebel 2006, eq. 290."""
    norm = np.linalg.norm(q, axis=1)
    wrong = np.flatnonzero(np.abs(norm - 1.0) > _NORM_TOLERANCE)
    if len(wrong):
        i = wrong[0]
        raise InvalidReference(
            f"{name}, line {lines[i]}: a quaternion of norm {norm[i]:.6g}, need 1"
        )
    x, y, z, w = q.T
    yaw: Float[Array, " rows"] = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return yaw


def _yaw_of_race_line(name: str, column: dict[str, Float[Array, " rows"]]) -> Float[Array, " rows"]:
    """Return the yaw, rad, from psi, which counts from the y axis or, in some files, the x axis."""
    psi = column["yaw"]
    travel = np.arctan2(np.diff(column["y"]), np.diff(column["x"]))
    off = np.abs(wrap(psi[:-1] - travel))
    if len(off) and float(np.median(off)) < 0.25 * pi:
        return psi
    _log.warning("%s: psi_rad counts from the y axis, as in race lines of TUM", name)
    return psi + 0.5 * pi


def _check_values(name: str, lines: list[int], table: Float[Array, "rows columns"]) -> None:
    beyond = np.argwhere(~(np.abs(table) <= MAX_VALUE))  # NaN as well
    if len(beyond):
        i, j = beyond[0]
        raise InvalidReference(
            f"{name}, line {lines[i]}: {table[i, j]:g} is not a finite number of at most "
            f"{MAX_VALUE:g} in magnitude"
        )
