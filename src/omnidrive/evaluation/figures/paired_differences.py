"""Paired differences of all controllers under the same noise."""

from __future__ import annotations

from math import isfinite
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from omnidrive.evaluation.figures.style import DARK, MUTED, PAGE, new_figure
from omnidrive.evaluation.paired import (
    MEASURE_LABELS,
    MEASURES,
    PairedDifference,
    needed_seeds,
    paired_differences,
)
from omnidrive.evaluation.results import StudyResults

_FILL = {"better": "#bfdff2", "worse": "#f8d9b0", "no difference shown": "#ececec"}


def noise_differences(results: StudyResults) -> Figure | None:
    """Draw a matrix per error: mean of row minus column over the seeds, with its 95 % interval."""
    found = paired_differences(results)
    longest = max((d.duration for d in found), default=0.0)
    found = [d for d in found if d.duration == longest]
    if not found:
        return None
    names = list(dict.fromkeys(name for d in found for name in (d.second, d.first)))
    tall = 0.5 + 0.42 * len(names)
    figure = new_figure(PAGE, 0.6 + 2.0 * tall)
    for axes, measure in zip(figure.subplots(2, 2).flat, MEASURES, strict=True):
        _matrix(axes, names, [d for d in found if d.measure == measure])
        axes.set_title(f"{MEASURE_LABELS[measure]} in m{MEASURES[measure]}")
    counts = sorted({d.difference.sample_size for d in found})
    count = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    needed = needed_seeds(found)
    few = f"; {counts[-1]} seeds are too few to show one, {needed} are needed."
    reason = " (5 %, Holm-corrected)." if counts[-1] >= needed else few
    figure.supxlabel(
        f"Row minus column: mean ± half its 95 % interval; {longest:g} s, {count} seeds.\n"
        f"Blue: row better; orange: row worse; grey: no difference shown{reason}",
        fontsize=7.5, color=MUTED,
    )  # fmt: skip
    return figure


def _matrix(axes: Axes, names: list[str], found: list[PairedDifference]) -> None:
    """Draw the lower triangle; the upper one has the same values with opposite sign."""
    rows, columns = names[1:], names[:-1]
    for d in found:
        row, column = rows.index(d.first), columns.index(d.second)
        corner = (column - 0.48, row - 0.46)
        axes.add_patch(Rectangle(corner, 0.96, 0.92, color=_FILL[d.verdict], lw=0.0))
        mean, margin, _, _ = d.difference.text(1e3)
        style: dict[str, Any] = {
            "ha": "center",
            "va": "center",
            "fontsize": 6.0,
            "color": DARK,
        }
        axes.text(column, row - 0.14, mean, fontweight="bold", **style)
        if isfinite(d.difference.margin):
            axes.text(column, row + 0.18, f"± {margin}", **style)
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5))
    axes.set_xticks(range(len(columns)), columns, rotation=30, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(rows)), rows)
    axes.tick_params(length=0.0)
    axes.grid(visible=False)
    for side in axes.spines.values():
        side.set_visible(False)
