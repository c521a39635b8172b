"""The paper's figures, drawn from a study."""

from omnidrive.evaluation.figures.catalogue import draw_figures, write_figures

__all__ = ["draw_figures", "write_figures"]
