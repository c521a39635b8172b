"""Base class of the sections of a scenario."""

from __future__ import annotations

from pydantic import AfterValidator, BaseModel, ConfigDict


class Section(BaseModel):
    """Section of a scenario file; unknown keys and non-finite numbers are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def _check_unique(values: tuple[object, ...]) -> tuple[object, ...]:
    if len({f"{v:g}" if isinstance(v, float) else v for v in values}) < len(values):
        raise ValueError("contains an item twice")
    return values


UniqueItems = AfterValidator(_check_unique)
"""Validator of a list without duplicates."""
