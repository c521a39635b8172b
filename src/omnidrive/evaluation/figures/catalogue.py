"""All figures of a study, and their files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from omnidrive.errors import InvalidInput, short_repr, suggestion
from omnidrive.evaluation.figures.comparison import heading_comparison, horizon_bars, xy_comparison
from omnidrive.evaluation.figures.effort import effort
from omnidrive.evaluation.figures.gain_history import gain_history, step_gain_history
from omnidrive.evaluation.figures.kinematics import kinematics
from omnidrive.evaluation.figures.membership import membership_functions
from omnidrive.evaluation.figures.paired_differences import noise_differences
from omnidrive.evaluation.figures.step_response import step_response
from omnidrive.evaluation.figures.style import figure_style, save
from omnidrive.evaluation.figures.tracking_error import tracking_error
from omnidrive.evaluation.results import StudyResults
from omnidrive.files.output_file import create_folder
from omnidrive.files.str_path import StrPath, to_path

Draw = Callable[[StudyResults], Figure | None]

_FIGURES: dict[str, Draw] = {
    "kinematics": lambda results: kinematics(results.robot),
    "tracking_error": lambda results: tracking_error(results.robot),
    "membership_functions": lambda results: (
        membership_functions(systems) if (systems := results.fuzzy_systems) else None
    ),
    "xy_comparison": lambda results: xy_comparison(results, "track"),
    "heading_comparison": lambda results: heading_comparison(results, "track"),
    "horizon_xy": lambda results: xy_comparison(results, "horizon"),
    "horizon_heading": lambda results: heading_comparison(results, "horizon"),
    "horizon_bars": horizon_bars,
    "step_response": step_response,
    "effort": effort,
    "noise_xy": lambda results: xy_comparison(results, "noise"),
    "noise_heading": lambda results: heading_comparison(results, "noise"),
    "noise_differences": noise_differences,
    "gain_history": gain_history,
    "step_gain_history": step_gain_history,
}


_DIAGRAMS = ("kinematics", "tracking_error", "membership_functions")
"""Figures without runs."""


def draw_figures(results: StudyResults) -> Iterator[tuple[str, Figure]]:
    """Yield name and figure of every figure for which the study has runs."""
    for name, draw in _FIGURES.items():
        with figure_style():
            figure = draw(results)
        if figure is not None:
            yield name, figure


def draw_figure(results: StudyResults, name: str | None = None) -> Figure:
    """Return one figure of a study.

    Args:
        results: Results of the study.
        name: Name of the figure, as of its file. None: the first figure that compares runs.

    Raises:
        InvalidInput: There is no such figure, or the study has no runs for it.
    """
    if name is not None and name not in _FIGURES:
        raise InvalidInput(f"there is no figure {short_repr(name)}{suggestion(name, _FIGURES)}")
    for each in _FIGURES if name is None else (name,):
        if name is None and each in _DIAGRAMS:
            continue
        with figure_style():
            figure = _FIGURES[each](results)
        if figure is not None:
            return figure
    drawn = ", ".join(each for each, _ in draw_figures(results))
    raise InvalidInput(
        f"the study has no runs for the figure {name or 'of a task'}; it has {drawn}"
    )


def write_figures(
    results: StudyResults, folder: StrPath, formats: Sequence[str] = ("svg", "pdf")
) -> Iterator[Path]:
    """Write every figure; equal results give identical files.

    Args:
        results: Results of the study; figures without runs are omitted.
        folder: Output folder; created if it does not exist.
        formats: Some of svg, pdf and png.

    Yields:
        Path of each file after it is written.

    Raises:
        CannotWrite: A file cannot be written.
    """
    folder = to_path(folder)
    create_folder(folder)
    for name, figure in draw_figures(results):
        for suffix in formats:
            path = folder / f"{name}.{suffix}"
            save(figure, path)
            yield path
