"""The space of the parameters of a controller, and its map to scaled coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from fnmatch import fnmatchcase
from math import exp, isfinite, log
from types import UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np
from jaxtyping import Float
from pydantic import ValidationError

from omnidrive.arrays import Array
from omnidrive.choices import PresetName
from omnidrive.components import Configured
from omnidrive.components.fields import field_names
from omnidrive.errors import InvalidInput, one_line, suggestion
from omnidrive.parameter import Bounds, check_choice, is_number

RATIO = 1.5
"""Factor of one scaled unit of a parameter with a logarithmic scale."""

SHARE = 0.1
"""Share of its range that is one scaled unit of another parameter; an integer: at least 1."""

TABLE = 20
"""Number of elements of a list beyond which they are tuned only if a pattern names them."""

_DECADES = 100.0  # ratio of bounds from which the scale is logarithmic
_MIN = 1e-3  # lower end of a logarithmic scale without a positive bound, per present value
_MAX = 1e3  # upper end of one without a finite bound


class Dimension(NamedTuple):
    """One tuned parameter."""

    name: str
    """Dotted path of the parameter, such as ``position.kp``; elements of lists by their index."""
    low: float
    """Least value."""
    high: float
    """Greatest value."""
    base: float
    """Value before tuning, within the range."""
    unit: str
    """Unit; 1: a ratio."""
    integer: bool
    """Whether the value is a whole number."""
    logarithmic: bool
    """Whether one scaled unit is a factor, :data:`RATIO`."""
    in_table: bool = False
    """Whether it is one of more than :data:`TABLE` numbers of a list."""

    @property
    def step(self) -> float:
        """One scaled unit of a linear scale."""
        return max(SHARE * (self.high - self.low), 1.0 if self.integer else 0.0)

    def scaled(self, value: float) -> float:
        """Return the scaled coordinate of a value: 0 for the value before tuning."""
        if self.logarithmic:
            return log(value / self.base) / log(RATIO)
        return (value - self.base) / self.step

    def value(self, scaled: float) -> float | int:
        """Return the value of a scaled coordinate, within the range."""
        raw = (
            self.base * exp(scaled * log(RATIO))
            if self.logarithmic
            else self.base + scaled * self.step
        )
        bounded = min(max(raw, self.low), self.high)
        return round(bounded) if self.integer else bounded


@dataclass(frozen=True, eq=False)
class ParameterSpace:
    """Parameters of a controller that are tuned, and the controller before tuning.

    Attributes:
        controller: The controller with the values that it uses.
        dimensions: The tuned parameters.
    """

    controller: Configured
    dimensions: tuple[Dimension, ...]

    @property
    def bounds(self) -> Float[Array, "dimensions 2"]:
        """Scaled bounds of every parameter."""
        return np.array(
            [[each.scaled(each.low), each.scaled(each.high)] for each in self.dimensions]
        )

    @property
    def base(self) -> dict[str, float | int]:
        """Values before tuning."""
        return {each.name: each.value(0.0) for each in self.dimensions}

    def values(self, scaled: Sequence[float]) -> dict[str, float | int]:
        """Return the values of scaled coordinates, by the name of the parameter."""
        return {each.name: each.value(x) for each, x in zip(self.dimensions, scaled, strict=True)}

    def controller_with(self, values: Mapping[str, float | int]) -> Configured | None:
        """Return the controller with other values; None if its parameter class refuses them."""
        data = deepcopy(self.controller.values)
        for name, value in values.items():
            _assign(data, name.split("."), value)
        try:
            return Configured(self.controller.component, self.controller.component.parse(data))
        except ValidationError:
            return None


def parameter_space(
    controller: Configured,
    preset: PresetName,
    *,
    choose: Sequence[str] = (),
    ranges: Mapping[str, tuple[float, float]] | None = None,
) -> ParameterSpace:
    """Return the space of the numbers of a controller that have bounds.

    A parameter of None is not tuned, unless the class of the parameters has a method
    ``resolved(preset)`` that gives it a value. Truth values and names are not tuned. The scale is
    logarithmic if the bounds span two decades or more and the value before tuning is positive.

    Args:
        controller: The controller.
        preset: Preset of the scenario.
        choose: Patterns of the names of the parameters to tune, such as ``position.*``; those that
            begin with ``!`` leave parameters out. Without others: all but the elements of long
            lists, such as the consequents of fuzzy rules, which would need many more trials.
        ranges: Narrower ranges by name.

    Raises:
        InvalidInput: A pattern matches no parameter, a range is not within the bounds, or nothing
            is left to tune.
    """
    check_choice("preset", preset, get_args(PresetName))
    resolved = controller.resolved(preset)
    found = _dimensions(type(resolved.parameters), resolved.parameters, "")
    if not found:
        raise InvalidInput(
            f"the controller {one_line(controller.type, 60)} has no parameter to tune: none is a "
            "number with bounds"
        )
    chosen = _chosen(found, choose)
    for name, limits in (ranges or {}).items():
        if name not in chosen:
            raise InvalidInput(
                f"there is no tuned parameter '{one_line(name, 60)}'{suggestion(name, chosen)}"
            )
        chosen[name] = _narrowed(chosen[name], limits)
    return ParameterSpace(resolved, tuple(map(_with_scale, chosen.values())))


def tunable(controller: Configured, preset: PresetName) -> bool:
    """Return whether a controller has a parameter to tune; see :func:`parameter_space`."""
    resolved = controller.resolved(preset)
    return bool(_dimensions(type(resolved.parameters), resolved.parameters, ""))


def _dimensions(hint: Any, value: Any, name: str) -> dict[str, Dimension]:
    """Return the tuned parameters of a value and its annotation, those of its parts included."""
    bare, bounds = _bare(hint)
    if is_number(value) and not isinstance(value, bool):
        if bounds is None:
            return {}
        number = float(value)
        whole = isinstance(value, int)
        return {name: Dimension(name, *bounds[:2], number, bounds.unit, whole, False)}
    parts: dict[str, tuple[Any, Any]] = {}
    if field_names(bare):
        hints = get_type_hints(bare, include_extras=True)
        parts = {each: (hints[each], getattr(value, each)) for each in field_names(bare)}
    elif get_origin(bare) is tuple and isinstance(value, tuple):
        inner = get_args(bare)
        inner = inner[:1] * len(value) if inner[-1] is ... else inner
        parts = {str(i): pair for i, pair in enumerate(zip(inner, value, strict=True))}
    found: dict[str, Dimension] = {}
    for part, (inner_hint, inner_value) in parts.items():
        if inner_value is not None:
            found |= _dimensions(inner_hint, inner_value, f"{name}.{part}" if name else part)
    if not field_names(bare) and len(found) > TABLE:
        return {each: found[each]._replace(in_table=True) for each in found}
    return found


def _bare(hint: Any) -> tuple[Any, Bounds | None]:
    """Return a type without annotations and None, and its bounds; None: it has none."""
    bounds = None
    while True:
        if get_origin(hint) is Annotated:
            hint, *metadata = get_args(hint)
            bounds = next((each for each in metadata if isinstance(each, Bounds)), bounds)
        elif get_origin(hint) in {Union, UnionType}:
            options = [each for each in get_args(hint) if each is not type(None)]
            if len(options) != 1:
                return hint, bounds
            (hint,) = options
        else:
            return hint, bounds


def _chosen(found: dict[str, Dimension], patterns: Sequence[str]) -> dict[str, Dimension]:
    """Return the parameters that the patterns choose."""
    for pattern in patterns:
        bare = pattern.removeprefix("!")
        if not any(fnmatchcase(name, bare) for name in found):
            raise InvalidInput(
                f"no parameter matches '{one_line(bare, 60)}'{suggestion(bare, list(found))}"
            )
    wanted = [each for each in patterns if not each.startswith("!")]
    unwanted = [each.removeprefix("!") for each in patterns if each.startswith("!")]
    chosen = {
        name: each
        for name, each in found.items()
        if (any(fnmatchcase(name, pattern) for pattern in wanted) if wanted else not each.in_table)
        and not any(fnmatchcase(name, pattern) for pattern in unwanted)
    }
    if not chosen:
        raise InvalidInput("nothing is left to tune: the patterns leave out every parameter")
    return chosen


def _narrowed(dimension: Dimension, limits: tuple[float, float]) -> Dimension:
    low, high = limits
    if not (dimension.low <= low < high <= dimension.high):
        unit = "" if dimension.unit in {"", "1"} else f" {dimension.unit}"
        raise InvalidInput(
            f"the range of {dimension.name} is {low:g} to {high:g}, need an increasing one within "
            f"{dimension.low:g} to {dimension.high:g}{unit}"
        )
    return dimension._replace(low=low, high=high)


def _with_scale(dimension: Dimension) -> Dimension:
    """Return a parameter with its scale, and finite bounds that contain the present value."""
    low, high, base = dimension.low, dimension.high, dimension.base
    base = min(max(base, low), high)
    logarithmic = base > 0.0 and low >= 0.0 and (low == 0.0 or high / low >= _DECADES)
    if logarithmic:
        low = max(low, _MIN * base)
        high = min(high, _MAX * base)
    elif not (isfinite(low) and isfinite(high)):
        span = max(abs(base), 1.0)
        low, high = max(low, base - span), min(high, base + span)
    return dimension._replace(low=low, high=high, base=base, logarithmic=logarithmic)


def _assign(data: Any, path: Sequence[str], value: float | int) -> None:
    """Set the element of nested dictionaries and lists at a path."""
    *outer, last = path
    for key in outer:
        data = data[int(key)] if isinstance(data, list) else data.setdefault(key, {})
    if isinstance(data, list):
        data[int(last)] = value
    else:
        data[last] = value
