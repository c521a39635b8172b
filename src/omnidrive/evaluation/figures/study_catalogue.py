"""All figures of the evidence of a study, with captions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from matplotlib.figure import Figure

from omnidrive.evaluation.evidence import StudyEvidence
from omnidrive.evaluation.figures.study_axes import axis_curves, heat_maps, share_bars
from omnidrive.evaluation.figures.study_cost import error_and_time
from omnidrive.evaluation.figures.study_distributions import distributions, paired_intervals
from omnidrive.evaluation.figures.style import figure_style
from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.evaluation.study_answer import TaskAnswer

_MAX_CURVES = 6  # axes with a figure of their own


class StudyFigure(NamedTuple):
    """A figure of a study."""

    name: str
    """Stem of its file."""
    title: str
    caption: str
    """What it shows, in one or two sentences."""
    figure: Figure


def study_figures(
    study: StudyEvidence, answers: Sequence[TaskAnswer], styles: Mapping[str, ControllerStyle]
) -> Iterator[StudyFigure]:
    """Yield every figure for which the study has runs."""
    draws: list[tuple[str, str, str, Callable[[], Figure | None]]] = [
        ("distributions", "Distributions", _DISTRIBUTIONS,
         lambda: distributions(study, answers, styles)),
        ("pairs", "Paired differences", _PAIRS, lambda: paired_intervals(answers)),
        ("cost", "Error and computing time", _COST,
         lambda: error_and_time(study, answers, styles)),
        ("shares", "What matters", _SHARES, lambda: share_bars(study, answers)),
        ("heat_maps", "Two axes", _HEAT_MAPS, lambda: heat_maps(study, answers)),
    ]  # fmt: skip
    for name, title, caption, draw in draws:
        with figure_style():
            figure = draw()
        if figure is not None:
            yield StudyFigure(name, title, caption, figure)
    for k, path in enumerate(study.runs.shown_axes[:_MAX_CURVES]):
        with figure_style():
            figure = axis_curves(study, answers, styles, path)
        if figure is not None:
            yield StudyFigure(f"axis_{k + 1}", f"By {path}", _CURVES, figure)


_DISTRIBUTIONS = (
    "Density over the finished runs, the best mean on top. Thick bar: quartiles; thin line: 5th to "
    "95th percentile; dot: median."
)
_PAIRS = (
    "Mean of the first minus the second controller under the same random numbers, with its 95 % "
    "interval. Blue: the first is better; orange: it is worse; grey: no difference shown "
    "(Holm-corrected)."
)
_COST = (
    "Mean with its 95 % interval against the median computing time of a step on the machine of the "
    "study. Filled, joined by the grey line: Pareto front, which no controller beats in both."
)
_SHARES = (
    "Share of the variance over all runs that each factor explains alone (first-order Sobol' "
    "index), from 10 repetitions on with its 95 % interval. The rest are interactions and random "
    "numbers."
)
_HEAT_MAPS = (
    "Mean over the finished runs at every combination of the two axes that explain most of the "
    "variance."
)
_CURVES = (
    "Mean over the repetitions and the other axes; band: 95 % interval. Below, if a run failed: "
    "share of the runs that reach the end of the reference."
)
