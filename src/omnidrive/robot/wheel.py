"""Wheels with passive rollers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from math import pi, sin, sqrt, tan
from typing import Any, NamedTuple

from omnidrive.robot.checks import check_no_faults, negative, not_positive

MAX_ROLLERS = 100
"""Largest number of rollers in one row."""
ROW_OVERLAP = 0.2
"""Share of the pitch of all rollers in which two rows carry load, because axles and contacts are
elastic."""


@dataclass(frozen=True, slots=True)
class OmniWheel:
    """Wheel with passive rollers; omni or mecanum, depending on the roller angle of its mount.

    Attributes:
        radius: Distance from the axle to the floor, in m.
        mass: Mass of hub and rim without rollers, in kg.
        rotor_inertia: Motor inertia reflected to the axle, in kg m^2.
        rollers_per_row: Number of rollers in each row.
        roller_radius: Largest radius of a roller, in m.
        roller_mass: Mass of one roller, in kg.
        row_gap: Distance between the centres of two rows, in m; for a single row, its width.
        rows: Number of rows of rollers, staggered: 2 for omni wheels, 1 for mecanum wheels.

    Raises:
        InvalidInput: A length or mass is not positive and finite, an inertia is negative, the
            rollers are larger than the wheel, or the number of rows or rollers is out of range.
    """

    radius: float
    mass: float
    rotor_inertia: float
    rollers_per_row: int = 9
    roller_radius: float = 0.0125
    roller_mass: float = 0.012
    row_gap: float = 0.022
    rows: int = 2

    def __post_init__(self) -> None:
        check_no_faults(
            wheel_faults({each.name: getattr(self, each.name) for each in fields(self)})
        )

    @property
    def total_mass(self) -> float:
        """Mass of hub, rim and rollers, in kg."""
        return self.mass + self.rollers * self.roller_mass

    @property
    def rollers(self) -> int:
        """Number of rollers in all rows."""
        return self.rows * self.rollers_per_row

    @property
    def hub_inertia(self) -> float:
        """Inertia of hub and rim about the axle, in kg m^2; a disc of 0.7 times the radius."""
        return 0.5 * self.mass * (0.7 * self.radius) ** 2


def contact_drift(wheel: OmniWheel, roller_angle: float) -> float:
    """Return how far along the axle the contact moves on half a roller, m, signed.

    A tilted roller ahead of the axle touches the floor behind its centre, hence beside the wheel.
    """
    return (wheel.radius - wheel.roller_radius) * tan(pi / wheel.rollers) * tan(roller_angle)


class ContactWave(NamedTuple):
    """Offset of a contact with the floor along the axle, periodic in the wheel angle."""

    period: float
    """Period in the wheel angle, rad."""
    fundamental: float
    """Root mean square of the fundamental, m."""
    harmonic: float
    """Root mean square of the strongest harmonic, m."""
    order: int
    """Number of this harmonic."""
    rest: float
    """Root mean square of all other harmonics, m."""


def contact_wave(wheel: OmniWheel, roller_angle: float) -> ContactWave:
    """Return the offset of a wheel's contacts: its mean squares by Fourier's series.

    Two rows that touch the floor by turns make a trapezoid wave of height ``row_gap / 2`` with
    ramps of :data:`ROW_OVERLAP` pitches; tilted rollers make a saw tooth of height
    :func:`contact_drift`, with half the period if there are two rows.
    """
    height, ramp = 0.5 * wheel.row_gap * (wheel.rows - 1), 0.5 * pi * ROW_OVERLAP
    first, third = (height * sqrt(8.0) / (n * pi) * sin(n * ramp) / (n * ramp) for n in (1.0, 3.0))
    drift = abs(contact_drift(wheel, roller_angle)) / sqrt(3.0)
    saw = drift * sqrt(6.0) / pi
    parts = (first, max((third, 3), (saw, 2))) if height > 0.0 else (saw, (0.5 * saw, 2))
    fundamental, (harmonic, order) = parts
    total = height**2 * (1.0 - 2.0 / 3.0 * ROW_OVERLAP) + drift**2
    rest = sqrt(max(total - fundamental**2 - harmonic**2, 0.0))
    return ContactWave(2.0 * pi / wheel.rollers_per_row, fundamental, harmonic, order, rest)


def wheel_faults(values: Mapping[str, Any]) -> list[str]:
    """Return all faults of values of the fields of :class:`OmniWheel`.

    Args:
        values: Values by name of the field, SI units. A missing one is the default; without a
            default, it is not checked.
    """
    defaults = {f.name: f.default for f in fields(OmniWheel) if f.default is not MISSING}
    values = {**defaults, **values}
    faults = []
    for name, unit in (
        ("radius", "m"), ("mass", "kg"), ("roller_radius", "m"), ("roller_mass", "kg"),
    ):  # fmt: skip
        if name in values:
            faults += not_positive(f"the wheels' {name}", values[name], unit)
    for name, unit in (("rotor_inertia", "kg m^2"), ("row_gap", "m")):
        if name in values:
            faults += negative(f"the wheels' {name}", values[name], unit)
    rollers, wheel = values["roller_radius"], values.get("radius")
    if not faults and wheel is not None and not rollers < wheel:
        faults.append(
            f"rollers of radius {rollers:g} m do not fit a wheel of radius {wheel:g} m: make the "
            "rollers smaller"
        )
    per_row, rows = values["rollers_per_row"], values["rows"]
    if not (3 <= per_row <= MAX_ROLLERS and 1 <= rows <= 4):
        faults.append(
            f"a wheel has {rows} rows of {per_row} rollers, need 1 to 4 rows of 3 to {MAX_ROLLERS}"
        )
    return faults
