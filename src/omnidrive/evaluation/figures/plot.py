"""The figure of a run, a plan or a study."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from matplotlib.figure import Figure

from omnidrive.errors import InvalidInput
from omnidrive.evaluation.figures.catalogue import Drawing, draw_figure
from omnidrive.evaluation.figures.plan import path_figure
from omnidrive.evaluation.figures.run import run_figure
from omnidrive.planning import Plan
from omnidrive.simulation import Run


@runtime_checkable
class HasFigures(Protocol):
    """Object with figures, such as :class:`omnidrive.study.Study`."""

    @property
    def figures(self) -> Mapping[str, Drawing]:
        """Figures by the stems of their files."""
        ...


def plot(shown: Run | Plan | HasFigures, figure: str | None = None) -> Figure:
    """Return a figure of matplotlib.

    Args:
        shown: A run: path, position error and heading error; a plan: the map with the path, and
            curvature and clearance along it; a study: ``figure``.
        figure: Name of the figure of a study: that of its file in the folder ``figures`` of a run
            folder, such as xy_comparison, heading_comparison, step_response or pairs.
            None: the first that compares runs.

    Raises:
        InvalidInput: There is no such figure, the study has no runs for it, or the object is
            another one.
    """
    if isinstance(shown, HasFigures):
        return draw_figure(shown.figures, figure)
    if figure is not None:
        raise InvalidInput(f"only a study has several figures, got figure={figure!r}")
    if isinstance(shown, Plan):
        return path_figure(shown.grid, shown.free_space, shown.grid_path, shown.spline)
    if isinstance(shown, Run):
        return run_figure(shown)
    raise InvalidInput(f"no figure of {type(shown).__name__}: need a Run, a Plan or a Study")
