"""What all sections of a scenario have in common."""

from __future__ import annotations

from pydantic import AfterValidator, BaseModel, ConfigDict


class Section(BaseModel):
    """A part of a scenario's file: no unknown keys, no numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def _all_different(values: tuple[object, ...]) -> tuple[object, ...]:
    if len({f"{v:g}" if isinstance(v, float) else v for v in values}) < len(values):
        raise ValueError("names something twice")
    return values


Different = AfterValidator(_all_different)
"""Of a list: nothing stands in it twice."""
