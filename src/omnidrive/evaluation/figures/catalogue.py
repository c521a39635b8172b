"""All figures of a study, and their files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from omnidrive.errors import InvalidInput, short_repr, suggestion
from omnidrive.evaluation.figures.comparison import heading_comparison, horizon_bars, xy_comparison
from omnidrive.evaluation.figures.effort import effort
from omnidrive.evaluation.figures.gain_history import gain_history, step_gain_history
from omnidrive.evaluation.figures.kinematics import kinematics
from omnidrive.evaluation.figures.membership import membership_functions
from omnidrive.evaluation.figures.step_response import step_response
from omnidrive.evaluation.figures.study_axes import axis_curves, heat_maps, share_bars
from omnidrive.evaluation.figures.study_cost import error_and_time
from omnidrive.evaluation.figures.study_distributions import distributions, paired_intervals
from omnidrive.evaluation.figures.style import figure_style, save
from omnidrive.evaluation.figures.tracking_error import tracking_error
from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.study_logs import StudyLogs
from omnidrive.evaluation.study_verdicts import has_evidence
from omnidrive.evaluation.verdict import TaskVerdict
from omnidrive.files.output_file import create_folder
from omnidrive.files.str_path import StrPath, to_path

_MAX_CURVES = 6  # axes with a figure of their own


class Drawing(NamedTuple):
    """A figure that is drawn on demand."""

    draw: Callable[[], Figure | None]
    """Returns the figure; None: the study has no runs for it."""
    title: str = ""
    caption: str = ""
    """What it shows, in one or two sentences; empty: the report shows it in another way."""


def drawings(
    study: StudyEvidence,
    verdicts: Sequence[TaskVerdict],
    styles: Mapping[str, ControllerStyle],
    logs: StudyLogs | None = None,
) -> dict[str, Drawing]:
    """Return all figures of a study by the stems of their files.

    Args:
        study: The evidence.
        verdicts: The verdict of each task.
        styles: Style of every controller by its label.
        logs: Logs of the study; None: they are not kept.
    """
    found = log_drawings(logs) if logs else {}
    if not has_evidence(study, verdicts):
        return found
    compared = [each for each in verdicts if not each.swept]
    found |= {
        "distributions": Drawing(
            lambda: distributions(study, compared, styles), "Distributions", _DISTRIBUTIONS
        ),
        "pairs": Drawing(lambda: paired_intervals(study, compared), "Paired differences", _PAIRS),
        "cost": Drawing(
            lambda: error_and_time(study, compared, styles), "Error and computing time", _COST
        ),
        "shares": Drawing(lambda: share_bars(study, verdicts), "What matters", _SHARES),
        "heat_maps": Drawing(lambda: heat_maps(study, verdicts), "Two axes", _HEAT_MAPS),
    }
    return found | {
        f"axis_{k + 1}": Drawing(
            partial(axis_curves, study, verdicts, styles, path), f"By {path}", _CURVES
        )
        for k, path in enumerate(study.runs.shown_axes[:_MAX_CURVES])
    }


def log_drawings(logs: StudyLogs) -> dict[str, Drawing]:
    """Return the figures of logs."""
    draws: dict[str, Callable[[], Figure | None]] = {
        "kinematics": lambda: kinematics(logs.robot),
        "tracking_error": lambda: tracking_error(logs.robot),
        "membership_functions": lambda: (
            membership_functions(systems) if (systems := logs.fuzzy_systems) else None
        ),
        "xy_comparison": lambda: xy_comparison(logs, "track"),
        "heading_comparison": lambda: heading_comparison(logs, "track"),
        "horizon_xy": lambda: xy_comparison(logs, "horizon"),
        "horizon_heading": lambda: heading_comparison(logs, "horizon"),
        "horizon_bars": lambda: horizon_bars(logs),
        "step_response": lambda: step_response(logs),
        "effort": lambda: effort(logs),
        "noise_xy": lambda: xy_comparison(logs, "noise"),
        "noise_heading": lambda: heading_comparison(logs, "noise"),
        "gain_history": lambda: gain_history(logs),
        "step_gain_history": lambda: step_gain_history(logs),
    }
    return {name: Drawing(draw) for name, draw in draws.items()}


_DIAGRAMS = ("kinematics", "tracking_error", "membership_functions")
"""Figures without runs."""


def drawn(drawing: Drawing) -> Figure | None:
    """Return a figure in the style of all figures; None: the study has no runs for it."""
    with figure_style():
        return drawing.draw()


def draw_figure(known: Mapping[str, Drawing], name: str | None = None) -> Figure:
    """Return one figure of a study.

    Args:
        known: All figures of the study.
        name: Name of the figure, as of its file. None: the first figure that compares runs.

    Raises:
        InvalidInput: There is no such figure, or the study has no runs for it.
    """
    if name is not None and name not in known:
        raise InvalidInput(f"there is no figure {short_repr(name)}{suggestion(name, known)}")
    for each in known if name is None else (name,):
        figure = None if name is None and each in _DIAGRAMS else drawn(known[each])
        if figure is not None:
            return figure
    names = ", ".join(each for each, drawing in known.items() if drawn(drawing) is not None)
    raise InvalidInput(
        f"the study has no runs for the figure {name or 'of a task'}; it has {names}"
    )


def write_figures(
    known: Mapping[str, Drawing], folder: StrPath, formats: Sequence[str] = ("svg",)
) -> Iterator[tuple[str, Path]]:
    """Write every figure; equal results give identical files.

    Args:
        known: All figures of the study; those without runs are omitted.
        folder: Output folder; created if it does not exist.
        formats: Some of svg, pdf and png.

    Yields:
        Name of the figure and path of each file after it is written.

    Raises:
        CannotWrite: A file cannot be written.
    """
    folder = to_path(folder)
    create_folder(folder)
    for name, drawing in known.items():
        figure = drawn(drawing)
        if figure is None:
            continue
        for suffix in formats:
            path = folder / f"{name}.{suffix}"
            save(figure, path)
            yield name, path


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
