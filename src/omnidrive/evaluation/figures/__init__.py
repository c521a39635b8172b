"""Figures of a study, including those of the paper, and figures of fuzzy systems."""

from omnidrive.evaluation.figures.catalogue import draw_figure, drawings, write_figures
from omnidrive.evaluation.figures.control_surface import control_surface
from omnidrive.evaluation.figures.membership import membership_figure
from omnidrive.evaluation.figures.plan import path_figure, plan_figure
from omnidrive.evaluation.figures.plot import plot
from omnidrive.evaluation.figures.rule_viewer import rule_viewer
from omnidrive.evaluation.figures.run import run_figure
from omnidrive.evaluation.figures.style import save

__all__ = [
    "control_surface",
    "draw_figure",
    "drawings",
    "membership_figure",
    "path_figure",
    "plan_figure",
    "plot",
    "rule_viewer",
    "run_figure",
    "save",
    "write_figures",
]
