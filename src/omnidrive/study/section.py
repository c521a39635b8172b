"""Base class of the sections of a scenario, and former names that are still accepted."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, model_validator


class Renamed(FutureWarning):
    """Warning that a former name was used; its message states the present one."""


def current_name(name: Any, old_names: Mapping[str, str]) -> Any:
    """Return the present name; warn with :class:`Renamed` if ``name`` is a former one."""
    if not (isinstance(name, str) and name in old_names):
        return name
    warnings.warn(f"'{name}' is now called '{old_names[name]}'", Renamed, stacklevel=3)
    return old_names[name]


def accepts(old_names: Mapping[str, str]) -> BeforeValidator:
    """Return a validator of one name that accepts former names as well."""
    return BeforeValidator(lambda name: current_name(name, old_names))


class Section(BaseModel):
    """Section of a scenario file; unknown keys and non-finite numbers are errors.

    Attributes:
        old_keys: Former and present names of keys.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    old_keys: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _current_keys(cls, data: Any) -> Any:
        """Replace former names of keys by the present ones."""
        if not isinstance(data, dict) or not cls.old_keys.keys() & data.keys():
            return data
        twice = [new for old, new in cls.old_keys.items() if old in data and new in data]
        if twice:
            raise ValueError(f"holds '{twice[0]}' and its former name; keep '{twice[0]}'")
        return {current_name(key, cls.old_keys): value for key, value in data.items()}


def _check_unique(values: tuple[object, ...]) -> tuple[object, ...]:
    if len({f"{v:g}" if isinstance(v, float) else v for v in values}) < len(values):
        raise ValueError("contains an item twice")
    return values


UniqueItems = AfterValidator(_check_unique)
"""Validator of a list without duplicates."""
