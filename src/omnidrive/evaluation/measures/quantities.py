"""Compared quantities of a run: names, units, units of display and direction."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.errors import InvalidInput, one_line, suggestion
from omnidrive.evaluation.measures.step_response import STEP_AXES
from omnidrive.files.number_text import parse_number


class Quantity(NamedTuple):
    """A metric of a run that studies compare and tuning improves."""

    name: str
    """Name of the column, such as ``me``."""
    label: str
    """Name in tables and figures, such as ``ME``."""
    unit: str = ""
    """Unit of the stored values; empty: dimensionless."""
    shown_unit: str = ""
    """Unit in tables and figures."""
    factor: float = 1.0
    """Factor from the stored to the shown unit."""
    lower_is_better: bool = True
    needs_finish: bool = True
    """Whether only a run that reaches the end of its reference has a comparable value."""
    meaning: str = ""
    """Definition, as a phrase."""

    @property
    def heading(self) -> str:
        """Label with the shown unit after a comma."""
        return f"{self.label}, {self.shown_unit}" if self.shown_unit else self.label

    @property
    def axis_label(self) -> str:
        """Label with the shown unit, for the axis of a figure."""
        return f"{self.label} in {self.shown_unit}" if self.shown_unit else self.label


def _length(name: str, label: str, meaning: str, **changes: bool) -> Quantity:
    return Quantity(name, label, "m", "mm", 1e3, meaning=meaning, **changes)


def _angle(name: str, label: str, meaning: str) -> Quantity:
    return Quantity(name, label, "rad", "mrad", 1e3, meaning=meaning)


def _seconds(name: str, label: str, meaning: str) -> Quantity:
    return Quantity(name, label, "s", "s", meaning=meaning)


def _step_quantities(axis: str) -> tuple[Quantity, ...]:
    """Return the step-response quantities of one axis."""
    return (
        Quantity(f"overshoot_{axis}", f"overshoot {axis}", "%", "%",
                 meaning=f"overshoot of the step response in {axis}"),
        _seconds(f"rise_time_{axis}", f"rise time {axis}",
                 f"time from 10 % to 90 % of the step in {axis}"),
        _seconds(f"settling_time_{axis}", f"settling time {axis}",
                 f"time after which the response in {axis} stays within 10 % of the step"),
    )  # fmt: skip


_ALL = (
    Quantity("finished", "success rate", "", "%", 100.0, lower_is_better=False, needs_finish=False,
             meaning="share of the runs that reach the end of their reference"),
    _length("me", "ME", "mean distance between true and reference position"),
    _angle("mae", "MAE", "mean absolute heading error"),
    _length("max_error", "max. error", "maximum distance between true and reference position"),
    _length("me_measured", "ME measured", "mean distance between measured and reference position"),
    _angle("mae_measured", "MAE measured", "mean absolute error of the measured heading"),
    _length("me_after_start", "ME after 2 s", "ME without the first 2 s"),
    _angle("mae_after_start", "MAE after 2 s", "MAE without the first 2 s"),
    _length("path_me", "path ME", "mean distance to the nearest point of the path"),
    _angle("path_mae", "path MAE", "mean absolute heading error at the nearest point of the path"),
    _seconds("arrival", "arrival", "time from which the robot stays within 0.05 m of the end"),
    Quantity("work", "work", "J", "J", meaning="mechanical work of the motors"),
    Quantity("wheel_acceleration", "effort", "rad/s^2", "rad/s²",
             meaning="mean absolute rate of change of the commanded wheel speeds"),
    Quantity("fallbacks", "fallbacks", meaning="steps without a converged solution"),
    _length("min_clearance", "min. clearance", "minimum distance between body and obstacles",
            lower_is_better=False, needs_finish=False),
    Quantity("collisions", "collisions", needs_finish=False, meaning="collisions with obstacles"),
    _seconds("settling_time", "settling time", "settling time of the slowest axis with a step"),
    *(each for axis in STEP_AXES for each in _step_quantities(axis)),
    Quantity("recovered", "recovered", lower_is_better=False, needs_finish=False,
             meaning="whether the robot recovers from the fault (1) or not (0)"),
    _seconds("time_to_recover", "time to recover", "time from the fault to recovery"),
    _length("worst_error", "worst error", "maximum error after the fault", needs_finish=False),
    Quantity("step_time_median", "step time", "us", "µs",
             meaning="median computing time of a controller step"),
    Quantity("step_time_p99", "step time p99", "us", "µs",
             meaning="99th percentile of the computing time of a controller step"),
)  # fmt: skip

QUANTITIES = {each.name: each for each in _ALL}
"""Quantities by name."""

_UNITS = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": 0.017453292519943295},
    "s": {"s": 1.0, "ms": 1e-3},
    "us": {"s": 1e6, "ms": 1e3, "us": 1.0, "µs": 1.0},
    "J": {"J": 1.0, "kJ": 1e3},
    "%": {"%": 1.0},
    "rad/s^2": {"rad/s^2": 1.0, "rad/s²": 1.0},
    "": {},
}
"""Accepted units by the stored unit, with their factors to it."""


def quantity(name: str) -> Quantity:
    """Return a quantity by its name; an unknown one has no unit, and lower values are better."""
    return QUANTITIES.get(name, Quantity(name, name))


def parse_value(text: str, of: Quantity) -> float:
    """Return a value with an optional unit, such as ``0.1mm``, in the stored unit of a quantity.

    Raises:
        InvalidInput: It is not a finite number with a unit of the quantity.
    """
    word = text.strip()
    end = len(word)
    while end and parse_number(word[:end]) is None:
        end -= 1
    number, unit = parse_number(word[:end]) if end else None, word[end:].strip()
    known = _UNITS[of.unit]
    if number is None:
        example = f"0.1{of.shown_unit}"
        raise InvalidInput(f"{one_line(text, 60)!r} is not a value of {of.name}, such as {example}")
    if unit and unit not in known:
        way = suggestion(unit, known) if known else "; it has no unit"
        raise InvalidInput(f"{one_line(unit, 60)!r} is not a unit of {of.name}{way}")
    return number * known.get(unit, 1.0)
