"""Base class of the sections of a scenario, and the names that scenarios used before."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, model_validator

OLD_CONTROLLERS = {"nmpc": "unicycle-nmpc", "recommended": "holonomic-nmpc"}
"""Former names of controllers, which still load."""
OLD_PLANTS = {"rollers": "mujoco-rollers", "ball": "mujoco-balls"}
"""Former names of plants, which still load."""


class Renamed(FutureWarning):
    """A name that still works, and the one to write instead."""


def current_name(name: Any, old_names: Mapping[str, str]) -> Any:
    """Return ``name``, or the present one of a former name with a :class:`Renamed` warning."""
    if not (isinstance(name, str) and name in old_names):
        return name
    warnings.warn(f"'{name}' is now called '{old_names[name]}'", Renamed, stacklevel=3)
    return old_names[name]


def accepts(old_names: Mapping[str, str]) -> BeforeValidator:
    """Return a validator of one name that accepts former names as well."""
    return BeforeValidator(lambda name: current_name(name, old_names))


class Section(BaseModel):
    """A part of a scenario file without unknown keys and without non-finite numbers.

    Attributes:
        old_keys: Former names of keys, which still load, and the present ones.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    old_keys: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _current_keys(cls, data: Any) -> Any:
        """Rename former keys."""
        if not isinstance(data, dict) or not cls.old_keys.keys() & data.keys():
            return data
        twice = [new for old, new in cls.old_keys.items() if old in data and new in data]
        if twice:
            raise ValueError(f"holds '{twice[0]}' and its former name; keep '{twice[0]}'")
        return {current_name(key, cls.old_keys): value for key, value in data.items()}


def _all_different(values: tuple[object, ...]) -> tuple[object, ...]:
    if len({f"{v:g}" if isinstance(v, float) else v for v in values}) < len(values):
        raise ValueError("lists an item twice")
    return values


UniqueItems = AfterValidator(_all_different)
"""Validator of a list whose items differ."""
