"""Columns of a table of waypoints: quantity and unit of each title."""

from __future__ import annotations

import re
from math import pi
from typing import NamedTuple

from omnidrive.errors import InvalidReference, closest, one_line, short_repr
from omnidrive.files.number_table import is_index

POSITION, QUATERNION, TWIST = ("x", "y"), ("qx", "qy", "qz", "qw"), ("vx", "vy", "yaw_rate")
UNNAMED = {
    2: ("x", "y"),
    3: ("x", "y", "yaw"),
    4: ("t", "x", "y", "yaw"),
    8: ("t", "x", "y", "z", *QUATERNION),
}
"""Quantities of a table without titles by the number of its columns; eight are those of TUM."""

_DEGREE = pi / 180.0
_TIME = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "nsec": 1e-9}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_ANGLE = {"rad": 1.0, "deg": _DEGREE, "degree": _DEGREE, "degrees": _DEGREE}
_SPEED = {"m_per_s": 1.0, "m_s": 1.0, "mps": 1.0}
_YAW_RATE = {
    "rad_per_s": 1.0, "rad_s": 1.0, "radps": 1.0,
    "deg_per_s": _DEGREE, "deg_s": _DEGREE, "degps": _DEGREE,
}  # fmt: skip
UNITS: dict[str, dict[str, float]] = {
    "t": _TIME, "x": _LENGTH, "y": _LENGTH, "yaw": _ANGLE,
    "vx": _SPEED, "vy": _SPEED, "yaw_rate": _YAW_RATE,
    **{key: {"": 1.0} for key in QUATERNION},
}  # fmt: skip
"""Factor of each unit of each quantity for SI units."""
_ALIASES = {
    "time": "t", "timestamp": "t", "stamp": "t", "theta": "yaw", "heading": "yaw", "psi": "yaw",
    "omega": "yaw_rate", "tx": "x", "ty": "y",
    **{f"q_{axis}": f"q{axis}" for axis in "xyzw"},
}  # fmt: skip
_MESSAGE = re.compile(r"(?:.*_)?(position|orientation)_([xyzw])")  # of ROS, in a table
_RACE_LINE = {"psi_rad", "kappa_radpm"}
_MAX_TITLE = 100


class Columns(NamedTuple):
    """Columns of a table that are read, and the titles of the others."""

    place: dict[str, int]
    """Index of the column of each quantity."""
    factor: dict[str, float]
    """Factor for SI units of each quantity, 0 where the title has no unit."""
    unused: tuple[str, ...]
    """Titles of the columns that are not read."""
    is_race_line: bool = False
    """Whether the titles are those of a race line of TUM (global_racetrajectory_optimization)."""


def quantity_of(title: str) -> tuple[str, str] | None:
    """Return the quantity and unit of a column title ("" for no unit), or None if unknown."""
    words = _words(title)
    message = _MESSAGE.fullmatch(words)
    if message:
        kind, axis = message.groups()
        words = axis if kind == "position" else f"q{axis}"
    for name in sorted((*UNITS, *_ALIASES), key=len, reverse=True):
        known = _ALIASES.get(name, name)
        if words == name:
            return known, ""
        unit = words.removeprefix(f"{name}_")
        if unit != words and unit in UNITS[known]:
            return known, unit
    return None


def table_columns(where: str, titles: tuple[str, ...]) -> Columns:
    """Return the columns of a table by its titles; those that are not needed are unused.

    Velocities are unused without times, or if one of the three is missing, and a quaternion beside
    a yaw. Index columns of pandas are unused without being listed.

    Raises:
        InvalidReference: There is no column x or y, or two of one quantity, or a title resembles
            that of a missing column, or has an unknown unit.
    """
    index: dict[str, int] = {}
    factor: dict[str, float] = {}
    for i, title in enumerate(titles):
        found = quantity_of(title)
        if found is None:
            continue
        quantity, unit = found
        if quantity in index:
            raise InvalidReference(f"{where}: two columns contain {quantity}; remove one")
        index[quantity] = i
        factor[quantity] = UNITS[quantity].get(unit, 0.0) if unit else 0.0
    if not all(key in index for key in TWIST) or "t" not in index:
        _leave_out(index, TWIST)
    if not all(key in index for key in QUATERNION) or "yaw" in index:
        _leave_out(index, QUATERNION)
    used = {*index.values()}
    unused = [each for i, each in enumerate(titles) if i not in used and not is_index(each)]
    has_yaw = "yaw" in index or QUATERNION[0] in index
    _check_missing(where, [*(k for k in POSITION if k not in index), *([] if has_yaw else ["yaw"])],
                   unused)  # fmt: skip
    is_race_line = {_words(each) for each in titles} >= _RACE_LINE
    return Columns(index, factor, tuple(one_line(each, 60) for each in unused), is_race_line)


def _leave_out(index: dict[str, int], quantities: tuple[str, ...]) -> None:
    for key in quantities:
        index.pop(key, None)


def _check_missing(where: str, missing: list[str], unused: list[str]) -> None:
    """Raise InvalidReference if x or y is missing, or a title seems to be a missing one's."""
    for key in missing:
        names = [key, *(alias for alias, known in _ALIASES.items() if known == key)]
        for title in unused:
            words = _words(title)
            if any(words.startswith(f"{name}_") for name in names):
                raise InvalidReference(
                    f"{where}: the unit of {short_repr(title)} is unknown; there are "
                    f"{', '.join(UNITS[key])}"
                )
            near = closest(words, names, cutoff=0.75)
            if near is not None and words != key:
                raise InvalidReference(
                    f"{where}: unknown column {short_repr(title)}; did you mean '{near}'?"
                )
    absent = [key for key in missing if key in POSITION]
    if absent:
        found = f"; there are {one_line(', '.join(unused), 100)}" if any(unused) else ""
        raise InvalidReference(
            f"{where}: there is no column {' and no column '.join(absent)}{found}"
        )


def _words(title: str) -> str:
    """Return a title in lower case with underscores instead of brackets and blanks."""
    plain = title[:_MAX_TITLE].lower().replace("/", " per ")
    return re.sub(r"[^a-z0-9]+", "_", plain).strip("_")
