"""Style and output of all figures."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogFormatter

from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path

DARK = "#1a1a1a"
"""Colour of references, axes and text."""
MUTED = "#8a8a8a"
"""Colour of auxiliary lines and captions."""
BLUE, GREEN, RED, PURPLE = "#0072b2", "#007a59", "#d55e00", "#a8558a"
"""Colours of diagrams and of single curves."""
DASHED, DOTTED = (0, (4, 2.5)), (0, (2, 2))
"""Line styles of references, limits and auxiliary lines."""
DPI = 160
"""Resolution of written images, pixels per inch."""
COLUMN, PAGE = 3.5, 7.16
"""Widths of a figure over one and over two columns of a journal, inches."""
_NOTEBOOK_DPI = 96
_MAX_COLUMNS = 8  # of a legend

_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.0,
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
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.columnspacing": 1.4,
    "legend.handlelength": 2.4,
    "text.parse_math": False,  # names of users are drawn literally
    "text.usetex": False,  # whatever a matplotlibrc in the working folder says
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
    "svg.hashsalt": "omnidrive",
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}


def figure_style() -> AbstractContextManager[None]:
    """Return the context in which figures are created and saved."""
    register_fonts()
    return mpl.rc_context(_STYLE)


class StyledFigure(Figure):
    """A figure that notebooks show as PNG without pyplot."""

    def _repr_png_(self) -> bytes:
        """Return the figure as PNG."""
        image = BytesIO()
        with figure_style():
            self.savefig(image, format="png", dpi=_NOTEBOOK_DPI)
        return image.getvalue()


@cache
def register_fonts() -> None:
    """Make the fonts of matplotlib available if its cache lacks them.

    The cache of the user is shared by all environments; one that was written while an environment
    was incomplete contains only the fonts of the system, and every formula then causes warnings.
    """
    folder = Path(mpl.get_data_path(), "fonts", "ttf")
    if not any(Path(font.fname).parent == folder for font in fontManager.ttflist):
        for path in sorted(folder.glob("*.ttf")):
            fontManager.addfont(path)


class _PlainLogFormatter(LogFormatter):
    """Formats the ticks of a logarithmic axis as plain numbers; the default one needs mathtext."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of a tick; empty where the default formatter has none."""
        return f"{x:g}" if super().__call__(x, pos) else ""


def set_log_scale(axes: Axes, which: Literal["x", "y"]) -> None:
    """Make one axis logarithmic."""
    axes.set(**{f"{which}scale": "log"})
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_formatter(_PlainLogFormatter())
    axis.set_minor_formatter(_PlainLogFormatter(labelOnlyBase=False, minor_thresholds=(1.0, 0.4)))


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure with constrained layout; width and height in inches."""
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06, wspace=0.03, hspace=0.03)
    return StyledFigure(figsize=(width, height), layout=layout)


def curve_style(style: ControllerStyle, k: int, count: int, rows: int) -> dict[str, Any]:
    """Return the line properties of curve ``k`` of ``count`` with ``rows`` points.

    Later curves are thinner, dashed and have markers at other points, so that equal curves stay
    visible.
    """
    period = max(rows // 6, 1)
    return {
        "color": style.colour.light,
        "ls": (0, style.dash) if style.dash else "-",
        "lw": 2.0 - 0.9 * k / max(count - 1, 1),
        "zorder": 2.0 + 0.01 * k,
        "marker": style.marker,
        "markevery": (k * period // max(count, 1), period),
        "ms": 3.2,
        "mfc": "white",
        "mew": 0.8,
    }


def legend_above(figure: Figure, axes: Axes) -> None:
    """Place the legend of ``axes`` above all panels, with as few rows as possible."""
    handles, labels = axes.get_legend_handles_labels()
    for count in range(min(len(labels), _MAX_COLUMNS), 0, -1):
        legend = figure.legend(handles, labels, loc="outside upper center", ncols=count)
        if legend.get_window_extent().width <= figure.bbox.width or count == 1:
            return
        legend.remove()


def hide_axes(axes: Axes) -> None:
    """Remove ticks and frame, and set equal scales, for a diagram."""
    axes.set_aspect("equal")
    axes.axis("off")


def save(figure: Figure, path: StrPath) -> None:
    """Write ``figure`` as PNG, SVG or PDF, by the suffix of ``path``, without a date.

    All files of a figure have the layout of the first one.

    Raises:
        CannotWrite: The file cannot be written.
    """
    path = to_path(path)
    metadata = {
        "png": {"Software": None},
        "svg": {"Date": None, "Creator": None},
        "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    }
    kind = path.suffix.removeprefix(".")
    # matplotlib also projects the uninitialised padding of surface faces
    with figure_style(), np.errstate(over="ignore", invalid="ignore"), output_file(path) as part:
        _arrange(figure)
        figure.savefig(part, format=kind, dpi=DPI, metadata=metadata[kind])


def _arrange(figure: Figure) -> None:
    """Place the panels of a figure, once: Matplotlib would draw it to do so, and again to write it.

    Texts are measured as in vector files, without the hinting of a resolution.
    """
    layout, canvas, dpi = figure.get_layout_engine(), figure.canvas, figure.dpi
    if layout is not None:
        FigureCanvasSVG(figure)
        layout.execute(figure)
        figure.set_layout_engine(None)
        figure.set_canvas(canvas)
        figure.dpi = dpi  # that of SVG is 72
