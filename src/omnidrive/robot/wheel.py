"""Wheels with passive rollers."""

from __future__ import annotations

from dataclasses import dataclass

from omnidrive.errors import InvalidInput
from omnidrive.robot.checks import check_not_negative, check_positive

MAX_ROLLERS = 100
"""Largest number of rollers in one row."""


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
        for name, value, unit in (
            ("radius", self.radius, "m"),
            ("mass", self.mass, "kg"),
            ("roller_radius", self.roller_radius, "m"),
            ("roller_mass", self.roller_mass, "kg"),
        ):
            check_positive(f"the wheels' {name}", value, unit)
        check_not_negative("the wheels' rotor_inertia", self.rotor_inertia, "kg m^2")
        check_not_negative("the wheels' row_gap", self.row_gap, "m")
        if not self.roller_radius < self.radius:
            raise InvalidInput(
                f"rollers of radius {self.roller_radius:g} m do not fit a wheel of radius "
                f"{self.radius:g} m: make the rollers smaller"
            )
        if not (3 <= self.rollers_per_row <= MAX_ROLLERS and 1 <= self.rows <= 4):
            raise InvalidInput(
                f"a wheel has {self.rows} rows of {self.rollers_per_row} rollers, "
                f"need 1 to 4 rows of 3 to {MAX_ROLLERS}"
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
