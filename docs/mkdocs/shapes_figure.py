"""Picture of all shapes of reference motions.

`python docs/mkdocs/shapes_figure.py` writes docs/images/shapes.png.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from omnidrive.evaluation.figures.style import DARK, figure_style, new_figure
from omnidrive.reference import (
    Circle,
    Eight,
    RaisedCosine,
    RandomSmooth,
    ShapeReference,
    Slalom,
    Square,
)

FILE = Path(__file__).parents[1] / "images" / "shapes.png"
SHAPES = {
    "circle": Circle(),
    "eight": Eight(),
    "square": Square(),
    "raised-cosine": RaisedCosine(),
    "slalom": Slalom(),
    "random-smooth": RandomSmooth(),
}
_ARROWS = 25
_BLUE = "#0072b2"


def shapes_figure() -> Figure:
    """Draw every shape with its default parameters, with headings at equal times."""
    with figure_style():
        figure = new_figure(8.6, 5.2)
        for axes, (name, shape) in zip(figure.subplots(2, 3).ravel(), SHAPES.items(), strict=True):
            x, y, yaw = ShapeReference(shape, 1.0).window(0.0, 1001, 1e-3)[:, :3].T
            axes.plot(x, y, color=DARK, lw=1.2)
            some = np.linspace(0, len(x) - 1, _ARROWS).astype(int)
            axes.quiver(x[some], y[some], np.cos(yaw[some]), np.sin(yaw[some]), color=_BLUE,
                        width=0.007, scale=18, zorder=3)  # fmt: skip
            axes.plot(x[0], y[0], "o", color=DARK, ms=5)
            axes.set_aspect("equal", adjustable="datalim")
            axes.margins(0.12)
            axes.set(title=name, xlabel="x in m", ylabel="y in m")
    return figure


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    with figure_style():
        shapes_figure().savefig(FILE, dpi=110)
