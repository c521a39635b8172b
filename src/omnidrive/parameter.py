"""What a tunable number means: its range and unit, written once with ``Annotated``."""

from __future__ import annotations

from typing import Any, NamedTuple, get_type_hints

from omnidrive.errors import InvalidScenario


class Bounds(NamedTuple):
    """Closed range and unit of one tunable parameter, attached with ``Annotated``."""

    low: float
    high: float
    unit: str


def bounds_of(params: type[Any]) -> dict[str, Bounds]:
    """Bounds of every annotated field of a parameter class, in field order."""
    hints = get_type_hints(params, include_extras=True)
    return {
        name: meta
        for name, hint in hints.items()
        for meta in getattr(hint, "__metadata__", ())
        if isinstance(meta, Bounds)
    }


def check(params: Any, where: str = "") -> None:
    """Raise :class:`InvalidScenario` for the first field of ``params`` outside its bounds.

    Args:
        params: An instance of a parameter class.
        where: What the message calls the instance, such as ``controllers.nmpc.``.
    """
    for name, (low, high, unit) in bounds_of(type(params)).items():
        value = getattr(params, name)
        if not low <= value <= high:  # also catches NaN
            raise InvalidScenario(
                f"{where}{name} is {value:g} {unit}, need {low:g} to {high:g} {unit}"
            )
