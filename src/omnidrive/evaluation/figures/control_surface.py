"""Control surface of a fuzzy system."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, suggestion
from omnidrive.evaluation.figures.membership import truncate
from omnidrive.evaluation.figures.style import BLUE, DARK, PAGE, figure_style, new_figure
from omnidrive.fuzzy import Inference, InputVariable

_SHADES = "viridis"
_NODES = 101  # along each of two inputs
_NODES_MANY_RULES = 31
_MANY_RULES = 2000


def control_surface(
    inference: Inference, output: str | None = None, held: Mapping[str, float] | None = None
) -> Figure:
    """Draw one output over its inputs: a curve for one input, a map and a 3-D surface for two.

    With more inputs, the first two that are not held are drawn. The others are held at the middle
    of their range; the figure shows their values.

    Args:
        inference: Fuzzy system with its inference options.
        output: Name of the output; None: the first output.
        held: Values of the inputs to hold, by name.

    Raises:
        InvalidInput: The output or an input does not exist, every input is held, or the inference
            rejects a value.
    """
    system = inference.system
    names = [each.name for each in system.outputs]
    name = names[0] if output is None else output
    if name not in names:
        raise InvalidInput(f"there is no output {name!r}{suggestion(name, names)}")
    point = {v.name: 0.5 * (v.low + v.high) for v in system.inputs}
    for each, value in (held or {}).items():
        if each not in point:
            raise InvalidInput(f"there is no input {each!r}{suggestion(each, list(point))}")
        point[each] = value
    free = [k for k, v in enumerate(system.inputs) if v.name not in (held or {})][:2]
    if not free:
        raise InvalidInput("every input is held; leave at least one input free")
    drawn = [system.inputs[k] for k in free]
    rest = {v.name: point[v.name] for k, v in enumerate(system.inputs) if k not in free}
    o = names.index(name)
    with figure_style():
        if len(free) == 1:
            figure = _curve(inference, o, drawn[0], list(point.values()), free[0])
        else:
            figure = _surface(inference, o, (drawn[0], drawn[1]), list(point.values()), free)
        if rest:
            figure.supxlabel(_held_text(rest), fontsize=8, color=DARK)
    return figure


def _held_text(rest: Mapping[str, float]) -> str:
    shown = [f"{truncate(name)} = {value:.4g}" for name, value in list(rest.items())[:6]]
    more = f" and {len(rest) - 6} more inputs held" if len(rest) > 6 else ""
    return f"with {', '.join(shown)}{more}"


def _curve(
    inference: Inference, o: int, variable: InputVariable, point: list[float], k: int
) -> Figure:
    at = np.linspace(variable.low, variable.high, 1001)
    rows = np.tile(point, (len(at), 1))
    rows[:, k] = at
    value, minimum, greatest = inference.batch(rows)[:, :, o]
    figure = new_figure(PAGE, 3.4)
    axes = figure.add_subplot()
    if inference.system.type > 1:
        axes.fill_between(at, minimum, greatest, color=BLUE, alpha=0.2, lw=0.0,
                          label="type-reduced interval")  # fmt: skip
        axes.plot(at, value, color=BLUE, label="midpoint")
        axes.legend(loc="best")
    else:
        axes.plot(at, value, color=BLUE)
    output = truncate(inference.system.outputs[o].name, 40)
    axes.set(title=output, xlabel=truncate(variable.name, 40), ylabel=output)
    axes.set_xlim(variable.low, variable.high)
    return figure


def _surface(
    inference: Inference,
    o: int,
    drawn: tuple[InputVariable, InputVariable],
    point: list[float],
    free: list[int],
) -> Figure:
    count = _NODES if len(inference.system.rules) < _MANY_RULES else _NODES_MANY_RULES
    x, y = (np.linspace(v.low, v.high, count) for v in drawn)
    across, up = np.meshgrid(x, y)
    rows = np.tile(point, (across.size, 1))
    rows[:, free[0]], rows[:, free[1]] = across.ravel(), up.ravel()
    value = inference.batch(rows)[0, :, o].reshape(across.shape)
    figure = new_figure(PAGE, 3.4)
    halves: Any = figure.subfigures(1, 2, width_ratios=(1.08, 1.0))
    left, right = halves
    flat = left.add_subplot()
    _draw_map(left, flat, x, y, value)
    flat.set_title(truncate(inference.system.outputs[o].name, 40))
    flat.set(xlabel=truncate(drawn[0].name, 40), ylabel=truncate(drawn[1].name, 40))
    flat.locator_params(nbins=5)
    surface = right.add_subplot(projection="3d")
    _draw_surface(surface, across, up, value)
    surface.set_xlabel(truncate(drawn[0].name), labelpad=0)
    surface.set_ylabel(truncate(drawn[1].name), labelpad=0)
    return figure


def _draw_map(figure: SubFigure, axes: Axes, x: Array, y: Array, value: Array) -> None:
    image = axes.pcolormesh(x, y, value, cmap=_SHADES, shading="gouraud", rasterized=True)
    if np.ptp(value) > 1e-9 * max(1.0, float(np.abs(value).max())):
        levels = MaxNLocator(8).tick_values(float(value.min()), float(value.max()))
        axes.contour(x, y, value, levels=levels, colors="white", linewidths=0.6, alpha=0.7,
                     negative_linestyles="solid")  # fmt: skip
    axes.grid(visible=False)
    bar = figure.colorbar(image, ax=axes, aspect=24, pad=0.02)
    bar.outline.set_linewidth(0.5)


def _draw_surface(axes: Any, across: Array, up: Array, value: Array) -> None:
    axes.plot_surface(across, up, value, cmap=_SHADES, rcount=50, ccount=50, lw=0.15,
                      edgecolor=(0.1, 0.1, 0.1, 0.35), antialiased=True)  # fmt: skip
    axes.view_init(elev=28.0, azim=_view(value))
    axes.set_box_aspect((1.0, 1.0, 0.7), zoom=0.86)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(5))
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
    axes.tick_params(labelsize=7, pad=0)


def _view(value: Array) -> float:
    """Return the azimuth of the view, in degrees: from the lowest corner of the surface."""
    corners = {
        -128.0: value[0, 0],
        -52.0: value[0, -1],
        52.0: value[-1, -1],
        128.0: value[-1, 0],
    }
    return min(corners, key=lambda azimuth: float(corners[azimuth]))
