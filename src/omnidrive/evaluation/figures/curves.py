"""Runs that belong in one figure, each with its name and colour."""

from __future__ import annotations

from typing import NamedTuple

from omnidrive.evaluation.palette import controller_colour, controller_label, horizon_colours
from omnidrive.evaluation.results import StudyResults, TrackResult


class Curve(NamedTuple):
    """One run in a figure."""

    label: str
    """For the legend."""
    colour: str
    """As ``#rrggbb``."""
    result: TrackResult
    """What is drawn."""


def curves(results: StudyResults, task: str) -> list[Curve]:
    """Runs of ``task`` over its longest duration; horizons from short to long."""
    runs = results.select(task)
    longest = max((r.duration for r in runs), default=0.0)
    runs = tuple(r for r in runs if r.duration == longest)
    if task != "horizon":
        return [
            Curve(controller_label(r.controller), controller_colour(r.controller).light, r)
            for r in runs
        ]
    runs = tuple(sorted(runs, key=lambda r: r.horizon or 0))
    inks = horizon_colours(len(runs))
    alone = len({r.controller for r in runs}) == 1
    return [
        Curve(
            f"N = {r.horizon}" if alone else f"{controller_label(r.controller)}, N = {r.horizon}",
            ink.light,
            r,
        )
        for r, ink in zip(runs, inks, strict=True)
    ]
