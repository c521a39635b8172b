"""Two commands of the same samples over time, and their difference."""

from __future__ import annotations

from collections.abc import Sequence

from jaxtyping import Float
from matplotlib.figure import Figure

from omnidrive.arrays import Array
from omnidrive.evaluation.figures.style import BLUE, DARK, PAGE, RED, legend_above, new_figure


def command_difference(
    t: Float[Array, " rows"],
    axes: Sequence[tuple[str, str]],
    logged: Float[Array, "rows axes"],
    replayed: Float[Array, "rows axes"],
) -> Figure:
    """Draw one row per axis: both commands on the left, their difference on the right.

    Args:
        t: Times, s.
        axes: Name and unit of each axis.
        logged: Commands of the log.
        replayed: Commands of the replay.
    """
    figure = new_figure(PAGE, 0.9 + 1.35 * len(axes))
    panels = figure.subplots(len(axes), 2, sharex=True, squeeze=False, width_ratios=(1.6, 1.0))
    for i, (name, unit) in enumerate(axes):
        both, difference = panels[i]
        both.step(t, logged[:, i], where="post", label="log", color=DARK, lw=1.6)
        both.step(t, replayed[:, i], where="post", label="replay", color=RED, lw=0.9)
        difference.step(t, replayed[:, i] - logged[:, i], where="post", color=BLUE, lw=0.9)
        both.set_ylabel(f"{name} in {unit}")
        for each in (both, difference):
            each.margins(x=0.0)
            each.ticklabel_format(axis="y", useOffset=False)
    panels[0, 1].set_title("replay minus log")
    for each in panels[-1]:
        each.set_xlabel("time in s")
    figure.align_ylabels(panels[:, 0])
    legend_above(figure, panels[0, 0])
    return figure
