"""The paper's figures, drawn from a study."""

from omnidrive.evaluation.figures.catalogue import draw_figures, write_figures
from omnidrive.evaluation.figures.route import route_figure
from omnidrive.evaluation.figures.style import save

__all__ = ["draw_figures", "route_figure", "save", "write_figures"]
