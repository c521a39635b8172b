"""All figures of a study, and their files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from matplotlib.figure import Figure

from omnidrive.evaluation.figures.comparison import heading_comparison, horizon_bars, xy_comparison
from omnidrive.evaluation.figures.gain_history import gain_history, step_gain_history
from omnidrive.evaluation.figures.kinematics import kinematics
from omnidrive.evaluation.figures.membership import membership_functions
from omnidrive.evaluation.figures.paired_differences import noise_differences
from omnidrive.evaluation.figures.step_response import step_response
from omnidrive.evaluation.figures.style import figure_style, save
from omnidrive.evaluation.figures.tracking_error import tracking_error
from omnidrive.evaluation.results import StudyResults

Draw = Callable[[StudyResults], Figure | None]

_FIGURES: dict[str, Draw] = {
    "kinematics": lambda results: kinematics(results.robot),
    "tracking_error": lambda results: tracking_error(results.robot),
    "membership_functions": lambda results: membership_functions(),
    "xy_comparison": lambda results: xy_comparison(results, "track"),
    "heading_comparison": lambda results: heading_comparison(results, "track"),
    "horizon_xy": lambda results: xy_comparison(results, "horizon"),
    "horizon_heading": lambda results: heading_comparison(results, "horizon"),
    "horizon_bars": horizon_bars,
    "step_response": step_response,
    "noise_xy": lambda results: xy_comparison(results, "noise"),
    "noise_heading": lambda results: heading_comparison(results, "noise"),
    "noise_differences": noise_differences,
    "gain_history": gain_history,
    "step_gain_history": step_gain_history,
}


def draw_figures(results: StudyResults) -> Iterator[tuple[str, Figure]]:
    """Yield name and figure of every figure for which the study has runs."""
    for name, draw in _FIGURES.items():
        with figure_style():
            figure = draw(results)
        if figure is not None:
            yield name, figure


def write_figures(results: StudyResults, folder: Path) -> Iterator[Path]:
    """Write every figure as PNG and SVG; equal results give identical files.

    Args:
        results: Results of the study; figures without runs are omitted.
        folder: Output folder; created if it does not exist.

    Yields:
        Path of each file after it is written.

    Raises:
        OSError: A file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in draw_figures(results):
        for suffix in ("png", "svg"):
            path = folder / f"{name}.{suffix}"
            save(figure, path)
            yield path
