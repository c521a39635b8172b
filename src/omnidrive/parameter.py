"""Checks of parameters, arguments and results: ranges with units, names, numbers, records."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import cache
from math import isfinite
from numbers import Integral, Real
from typing import Any, NamedTuple, cast, get_type_hints

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from omnidrive.errors import InvalidInput, closest, kind_of, short_repr


class Bounds(NamedTuple):
    """Closed range and unit of one tunable parameter, attached with ``Annotated``.

    Pydantic checks the values in scenario files against it.
    """

    low: float
    high: float
    unit: str = "1"
    """Unit; 1: a ratio."""

    def check(self, value: float) -> float:
        """Return ``value``; raise ValueError if it is out of range or NaN."""
        if not self.low <= value <= self.high:  # also catches NaN
            unit = "" if self.unit in {"", "1"} else f" {self.unit}"
            raise ValueError(f"is {value:g}{unit}, need {self.low:g} to {self.high:g}{unit}")
        return value

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return the schema by which pydantic checks the value after its type."""
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON schema with the range and, as the keyword ``unit``, the unit."""
        limits = {"minimum": self.low, "maximum": self.high}
        known = {name: value for name, value in limits.items() if isfinite(value)}
        unit = {} if self.unit in {"", "1"} else {"unit": self.unit}
        return handler(schema) | known | unit


def bounds_of(params: type[Any]) -> dict[str, Bounds]:
    """Return the bounds of all annotated fields of a parameter class, in field order."""
    found: dict[str, Bounds] = _bounds_of(cast(Any, params))
    return dict(found)


@cache  # evaluating the annotations takes a fifth of a millisecond
def _bounds_of(params: Any) -> dict[str, Bounds]:
    hints = get_type_hints(params, include_extras=True)
    return {
        name: meta
        for name, hint in hints.items()
        for meta in getattr(hint, "__metadata__", ())
        if isinstance(meta, Bounds)
    }


def check_bounds(parameters: object) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` unless every value is within its bounds.

    Args:
        parameters: Instance of a parameter class; its fields with :class:`Bounds` are checked.
    """
    for name, bounds in bounds_of(type(parameters)).items():
        check_number(name, getattr(parameters, name), bounds)


def check_number(name: str, value: Any, bounds: Bounds) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` unless ``value`` is a number within bounds.

    Args:
        name: Name of the value for the message.
        value: The argument to check; any object.
        bounds: Range and unit.
    """
    if not is_number(value):
        raise InvalidInput(f"{name} must be a number, got {short_repr(value)}")
    try:
        bounds.check(float(value))
    except ValueError as error:
        raise InvalidInput(f"{name} {error}") from None


def check_choice(what: str, name: object, known: Collection[str]) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` unless ``name`` is one of the known names.

    Args:
        what: Kind of the name for the message, such as "search method".
        name: The argument to check; any object.
        known: The known names; the message lists them and suggests the closest.
    """
    if not isinstance(name, str):
        raise InvalidInput(f"a {what} is one of {', '.join(known)}, got {short_repr(name)}")
    if name not in known:
        near = closest(name, known)
        hint = f"; did you mean '{near}'?" if near else ""
        raise InvalidInput(
            f"there is no {what} {short_repr(name)}; there are {', '.join(known)}{hint}"
        )


TIME_TOLERANCE = 1e-9
"""Tolerance, s, of comparisons between times that are multiples of different periods: both have
rounding errors."""
_SAMPLE_TIMES = Bounds(1e-9, 3600.0, "s")


def check_sample_time(dt: object) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` unless ``dt`` is a number, 1e-9 to 3600 s."""
    check_number("the sample time", dt, _SAMPLE_TIMES)


Rule = tuple[Callable[[Any], bool], str]
"""A condition on the value of a field, and what is needed instead of another value."""


def record_fault(record: object, cls: type, rules: Mapping[str, Rule]) -> str | None:
    """Return what is wrong with the result of a part, in one line; None: nothing.

    Args:
        record: What the part returned.
        cls: Class that it must have.
        rules: Rule of each field to check, in this order.
    """
    if not isinstance(record, cls):
        return f"it returned {kind_of(record)}, not a {cls.__name__}"
    for name, (holds, need) in rules.items():
        value = getattr(record, name)
        if not holds(value):
            return f"{name} of its {cls.__name__} is {short_repr(value)}, need {need}"
    return None


def numbers_rule(cls: type) -> Rule:
    """Return the rule that a value is a ``cls``, a class of tuples, and consists of numbers."""
    return (
        lambda value: isinstance(value, cls) and are_numbers(value),
        f"a {cls.__name__} of numbers",
    )


def or_none(rule: Rule) -> Rule:
    """Return the rule that a value is None or satisfies ``rule``."""
    holds, need = rule
    return lambda value: value is None or holds(value), f"{need} or None"


def are_numbers(values: object) -> bool:
    """Return whether ``values`` is a tuple of real numbers; NaN and infinity are among these."""
    if not isinstance(values, tuple):
        return False
    return set(map(type, values)) == {float} or all(map(is_number, values))


def are_finite(values: object) -> bool:
    """Return whether ``values`` is a tuple of finite real numbers."""
    return are_numbers(values) and all(map(isfinite, cast(tuple[float, ...], values)))


def is_number(value: Any) -> bool:
    """Return whether ``value`` is a real number that a float can hold."""
    if isinstance(value, float):
        return True
    if isinstance(value, Integral):
        return -(2**1000) < int(value) < 2**1000
    return isinstance(value, Real)


def is_count(value: Any) -> bool:
    """Return whether ``value`` is a whole number from 0 to 2^31 - 1."""
    return isinstance(value, Integral) and 0 <= int(value) < 2**31
