"""How the error depends on the prediction horizon."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from omnidrive.evaluation.figures.curves import Curve, curves
from omnidrive.evaluation.figures.style import new_figure
from omnidrive.evaluation.results import StudyResults


def horizon_bars(results: StudyResults) -> Figure | None:
    """ME and MAE of each horizon."""
    lines = curves(results, "horizon")
    if not lines:
        return None
    figure = new_figure(7.2, 3.0)
    distance, turn = figure.subplots(1, 2)
    metrics = [line.result.metrics for line in lines]
    _bars(distance, lines, [m.me * 1e3 for m in metrics], "ME in mm")
    _bars(turn, lines, [m.mae * 1e3 for m in metrics], "MAE in mrad")
    distance.set_title("Mean position error")
    turn.set_title("Mean absolute heading error")
    return figure


def _bars(axes: Axes, lines: list[Curve], heights: list[float], label: str) -> None:
    places = range(len(lines))
    bars = axes.bar(places, heights, width=0.68, color=[line.colour for line in lines])
    axes.bar_label(bars, fmt="%.2f", padding=2, fontsize=7.5)
    names = [line.label.removeprefix("N = ") for line in lines]
    axes.set_xticks(places, names, rotation=0 if max(map(len, names)) < 4 else 45)
    axes.set(xlabel="prediction horizon N in steps", ylabel=label)
    axes.margins(y=0.12)
    axes.grid(visible=False, axis="x")
