"""Style and output of all figures."""

from __future__ import annotations

from contextlib import AbstractContextManager
from io import BytesIO
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from omnidrive.files.output_file import atomic_file
from omnidrive.files.str_path import StrPath, to_path

DARK = "#1a1a1a"
"""Colour of references, axes and text."""
MUTED = "#8a8a8a"
"""Colour of auxiliary lines and captions."""
DPI = 160
"""Resolution of written images, pixels per inch."""
_NOTEBOOK_DPI = 96

_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.edgecolor": DARK,
    "axes.labelcolor": DARK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "xtick.color": DARK,
    "ytick.color": DARK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 8,
    "legend.columnspacing": 1.4,
    "legend.handlelength": 1.7,
    "svg.hashsalt": "omnidrive",
    "svg.fonttype": "path",
}


def figure_style() -> AbstractContextManager[None]:
    """Return the context in which figures are created and saved."""
    return mpl.rc_context(_STYLE)


class StyledFigure(Figure):
    """A figure that notebooks show as PNG without pyplot."""

    def _repr_png_(self) -> bytes:
        """Return the figure as PNG."""
        image = BytesIO()
        with figure_style():
            self.savefig(image, format="png", dpi=_NOTEBOOK_DPI)
        return image.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure with constrained layout; width and height in inches."""
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06, wspace=0.03, hspace=0.03)
    return StyledFigure(figsize=(width, height), layout=layout)


def legend_above(figure: Figure, axes: Axes, columns: int = 8) -> None:
    """Place the legend of ``axes`` above all panels, with as few rows as possible."""
    handles, labels = axes.get_legend_handles_labels()
    for count in range(min(len(labels), columns), 0, -1):
        legend = figure.legend(handles, labels, loc="outside upper center", ncols=count)
        if legend.get_window_extent().width <= figure.bbox.width or count == 1:
            return
        legend.remove()


def hide_axes(axes: Axes) -> None:
    """Remove ticks and frame, and set equal scales, for a diagram."""
    axes.set_aspect("equal")
    axes.axis("off")


def save(figure: Figure, path: StrPath) -> None:
    """Write ``figure`` as PNG or SVG, by the suffix of ``path``, without a date."""
    path = to_path(path)
    metadata = {"png": {"Software": None}, "svg": {"Date": None, "Creator": None}}
    kind = path.suffix.removeprefix(".")
    # matplotlib also projects the uninitialised padding of surface faces
    with figure_style(), np.errstate(over="ignore", invalid="ignore"), atomic_file(path) as part:
        figure.savefig(part, format=kind, dpi=DPI, metadata=metadata[kind])
