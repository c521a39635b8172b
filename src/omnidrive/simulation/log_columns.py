"""Columns of the log of a run, by name and unit."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float, Int

from omnidrive.arrays import Array

POSE = (("x", "m"), ("y", "m"), ("yaw", "rad"))
"""Names and units of the fields of a pose."""
TWIST = (("vx", "m/s"), ("vy", "m/s"), ("yaw_rate", "rad/s"))
"""Names and units of the fields of a twist."""


class LogColumn(NamedTuple):
    """One quantity of a log, one value per sample."""

    name: str
    """Name, as in the files of a run folder."""
    unit: str
    """Unit; "1" for a number without unit."""
    values: Float[Array, " rows"] | Int[Array, " rows"]
    """Values; NaN if unknown."""


def vector_columns(
    prefix: str, fields: tuple[tuple[str, str], ...], values: Float[Array, "rows fields"]
) -> list[LogColumn]:
    """Return one column per field of a vector.

    Args:
        prefix: Beginning of the name of each column, before the name of the field.
        fields: Name and unit of each field.
        values: One row per sample.
    """
    return [LogColumn(prefix + name, unit, values[:, i]) for i, (name, unit) in enumerate(fields)]
